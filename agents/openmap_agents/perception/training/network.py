"""The convolutional part that is trained: the backbone's maps and depth's maps -> features of shape, of looks, and of belonging.

Two small networks, of which the second reads the first. ``shape`` sees depth alone (normals, height, distance), so what it learns
of a chair holds whatever the chair is painted like. ``looks`` also sees the frozen backbone's maps. Both end in a map of stride 8
whose mean under a mask describes a thing; ``belonging`` ends at stride 4 in a space where the pixels of one thing lie together,
and in the odds of a pixel's being thing, wall, floor or ceiling.
"""

from __future__ import annotations

import torch
from torch import nn

from openmap_agents.perception.backbone import CHANNELS
from openmap_agents.perception.maps import N_BELONGING, N_CLASSES, N_GEOMETRY
from openmap_agents.perception.neck import N_LOOKS, N_SHAPE_MAP

_SHAPE, _LOOKS = 48, 64


def _conv(inputs: int, outputs: int, size: int = 1, stride: int = 1, groups: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class _Residual(nn.Module):
    """An inverted residual: wider, depthwise k x k, narrower (Sandler et al., MobileNetV2, CVPR 2018)."""

    def __init__(self, channels: int, wider: int = 2, size: int = 5) -> None:
        super().__init__()
        inner = channels * wider
        self.steps = nn.Sequential(
            _conv(channels, inner),
            _conv(inner, inner, size, groups=inner),
            nn.Conv2d(inner, channels, 1, bias=False),
            nn.BatchNorm2d(channels),
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y: torch.Tensor = x + self.steps(x)
        return y


def _doubled(x: torch.Tensor) -> torch.Tensor:
    return nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")


class Shape(nn.Module):
    """Depth's maps (B, 6, h4, w4) -> (B, 16, h4, w4), (B, 48, h8, w8)."""

    def __init__(self) -> None:
        super().__init__()
        self.fine = _conv(N_GEOMETRY, 16, 3)
        self.down = _conv(16, _SHAPE, 3, 2)
        self.blocks = nn.Sequential(_Residual(_SHAPE), _Residual(_SHAPE))
        self.coarse = nn.Sequential(_conv(_SHAPE, 96, 3, 2), _Residual(96), _Residual(96), _conv(96, _SHAPE))
        self.last = nn.Sequential(_conv(2 * _SHAPE, _SHAPE), _Residual(_SHAPE))

    def forward(self, geometry: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        fine = self.fine(geometry)
        x = self.blocks(self.down(fine))
        return fine, self.last(torch.cat([x, _doubled(self.coarse(x))], 1))


class Neck(nn.Module):
    """Maps of strides 4, 8, 16 and depth's maps -> shape (B, N_SHAPE_MAP, h8, w8), looks (B, N_LOOKS, h8, w8), belonging (h4, w4).

    Parameters
    ----------
    means, stds : [(C,)] of each stride
        Of the backbone's channels, to begin from numbers of one size.
    """

    def __init__(self, means: list[torch.Tensor], stds: list[torch.Tensor]) -> None:
        super().__init__()
        for i, (mean, std) in enumerate(zip(means, stds, strict=True)):
            self.register_buffer(f"mean{i}", mean[:, None, None].clone())
            self.register_buffer(f"std{i}", std[:, None, None].clone())
        self.shape = Shape()
        self.shape_out = nn.Conv2d(_SHAPE, N_SHAPE_MAP, 1)
        self.in4, self.in8, self.in16 = _conv(CHANNELS[0], 16), _conv(CHANNELS[1], _LOOKS), _conv(CHANNELS[2], _LOOKS)
        self.mix = _conv(2 * _LOOKS + _SHAPE, _LOOKS)
        self.blocks = nn.Sequential(_Residual(_LOOKS), _Residual(_LOOKS))
        self.looks_out = nn.Conv2d(_LOOKS, N_LOOKS, 1)
        self.fine = nn.Sequential(_conv(16 + 16 + _LOOKS, 32), _conv(32, 32, 3, groups=32))
        self.fine_out = nn.Conv2d(32, N_BELONGING + N_CLASSES, 1)

    def scaled(self, i: int, x: torch.Tensor) -> torch.Tensor:
        """The backbone's map of stride 4 * 2^i with channels of mean 0 and deviation 1."""
        y: torch.Tensor = (x - getattr(self, f"mean{i}")) / getattr(self, f"std{i}")
        return y

    def forward(
        self, s4: torch.Tensor, s8: torch.Tensor, s16: torch.Tensor, geometry: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        fine, shape = self.shape(geometry)
        s4, s8, s16 = self.scaled(0, s4), self.scaled(1, s8), self.scaled(2, s16)
        x = self.mix(torch.cat([self.in8(s8), _doubled(self.in16(s16)), shape], 1))
        x = self.blocks(x)
        belonging = self.fine_out(self.fine(torch.cat([self.in4(s4), fine, _doubled(x)], 1)))
        return self.shape_out(shape), self.looks_out(x), belonging
