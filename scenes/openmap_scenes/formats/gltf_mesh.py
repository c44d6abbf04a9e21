"""A glTF document -> one textured mesh: node transforms, primitives, materials, vertex colours.

glTF's base colour factors and vertex colours are linear and are brought to sRGB here, since a Scene holds display values.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import Value
from openmap_scenes.formats.gltf import COMPRESSED, UNPACK, Document, read_document
from openmap_scenes.formats.images import EncodedImage, basis_error, decode_images
from openmap_scenes.formats.mesh import Part, TexturedMesh, check_mesh, moved, srgb_from_linear
from openmap_scenes.scene import Material

# One mesh may stand in the scene many times; what a document unrolls to is bounded.
MOST_FACES = 100_000_000
TRIANGLES, STRIP, FAN = 4, 5, 6
# sRGB byte of each sixteen-bit linear value.
SRGB_OF_U16 = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint8)


@dataclass(frozen=True)
class _Look:
    """A material, which texture coordinates it reads, and how they are moved: uv' = A (2, 2) uv + b (2,)."""

    material: Material
    texcoord: int = 0
    A: npt.NDArray[np.float64] | None = None
    b: npt.NDArray[np.float64] | None = None


@dataclass
class _Pile:
    """Arrays that the parts add up to."""

    vertices: list[npt.NDArray[np.float32]] = field(default_factory=list)
    uvs: list[npt.NDArray[np.float32] | None] = field(default_factory=list)
    colours: list[npt.NDArray[np.uint8] | None] = field(default_factory=list)
    faces: list[npt.NDArray[np.int32]] = field(default_factory=list)
    materials: list[int] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    n_vertices: int = 0
    n_faces: int = 0


def read_gltf(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    """Every triangle of a .glb or .gltf file, brought to the world frame by ``T_world_file`` (4, 4); DataError where it is broken.

    Faces keep the file's order: by node, depth first, then by primitive. Materials keep the document's order.
    """
    document = read_document(path)
    looks = _looks(document)
    pile = _Pile()
    meshes = document.top["meshes"].items()
    for node, T_file_node in _nodes(document):
        if node["mesh"].exists:
            mesh = meshes[node["mesh"].pick(meshes, "meshes")]
            _add_mesh(document, mesh, T_world_file @ T_file_node, node["name"].text(""), looks, pile)
    if not pile.n_faces:
        raise DataError(path, "no triangles", "a triangle mesh")
    return check_mesh(_joined(pile, [look.material for look in looks]), path)


def files_gltf(path: Path) -> list[Path]:
    """The file, its buffers, and those of its images that are there; DataError where a buffer is not."""
    document = read_document(path)
    named = [document.image_at(number).content for number in range(len(document.images))]
    return list(dict.fromkeys(document.files + [c for c in named if isinstance(c, Path) and c.is_file()]))


def _nodes(document: Document) -> list[tuple[Value, npt.NDArray[np.float64]]]:
    """Every node of the scene with its transform into the file's frame (4, 4), depth first."""
    nodes = document.top["nodes"].items()
    scenes = document.top["scenes"].items()
    if scenes:
        start = scenes[document.top["scene"].pick(scenes, "scenes") if document.top["scene"].exists else 0]
        roots = [reference.pick(nodes, "nodes") for reference in start["nodes"].items()]
    else:
        children = {r.pick(nodes, "nodes") for node in nodes for r in node["children"].items()}
        roots = [n for n in range(len(nodes)) if n not in children]
    found, seen = [], set()
    stack = [(root, np.eye(4)) for root in reversed(roots)]
    while stack:
        number, T_file_parent = stack.pop()
        node = nodes[number]
        if number in seen:
            node.fail("a tree of nodes, in which each has one parent", found="a node that is reached twice")
        seen.add(number)
        with np.errstate(over="ignore", invalid="ignore"):
            T_file_node = T_file_parent @ _local(node)
        if not np.isfinite(T_file_node).all():
            node.fail("a finite transform", found="a transform that overflows")
        found.append((node, T_file_node))
        stack += [(r.pick(nodes, "nodes"), T_file_node) for r in reversed(node["children"].items())]
    return found


def _local(node: Value) -> npt.NDArray[np.float64]:
    """A node's transform into its parent's frame (4, 4)."""
    if node["matrix"].exists:
        return np.array(node["matrix"].numbers(16), np.float64).reshape(4, 4).T
    x, y, z, w = node["rotation"].numbers(4, (0.0, 0.0, 0.0, 1.0))
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    if not 1e-6 < norm < 1e6:
        node["rotation"].fail("a unit quaternion")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    with np.errstate(over="ignore"):  # the caller looks whether it is finite
        T[:3, :3] *= np.array(node["scale"].numbers(3, (1.0, 1.0, 1.0)))
    T[:3, 3] = node["translation"].numbers(3, (0.0, 0.0, 0.0))
    return T


def _add_mesh(
    document: Document, mesh: Value, T: npt.NDArray[np.float64], node_name: str, looks: list[_Look], pile: _Pile
) -> None:
    """Add the primitives of a mesh under the transform T (4, 4) to the world frame."""
    # Primitives often share their vertices and differ in which faces they list; the vertices are then kept once.
    shared: dict[tuple[object, ...], tuple[int, int]] = {}
    is_mirrored = bool(np.linalg.det(T[:3, :3]) < 0)
    for primitive in mesh["primitives"].items():
        mode = primitive["mode"].integer(0, 6, TRIANGLES)
        if mode < TRIANGLES:
            continue
        material = _material_of(primitive, looks)
        look, attributes = looks[material], primitive["attributes"]
        if not attributes["POSITION"].exists:
            _no_position(primitive)
        key = (
            attributes["POSITION"].raw, attributes[f"TEXCOORD_{look.texcoord}"].raw, attributes["COLOR_0"].raw,
            None if look.A is None else look.A.tobytes(), None if look.b is None else look.b.tobytes(),
        )  # fmt: skip
        hash_key = tuple(map(repr, key))
        if hash_key not in shared:
            shared[hash_key] = _add_vertices(document, attributes, look, T, pile)
        offset, n_vertices = shared[hash_key]
        faces = _faces(document, primitive, mode, n_vertices)
        if pile.n_faces + len(faces) > MOST_FACES:
            mesh.fail(f"at most {MOST_FACES} faces in all", "Split the scene.", "too many faces")
        faces = faces + np.int32(offset)
        pile.faces.append(faces[:, [0, 2, 1]] if is_mirrored else faces)
        pile.materials.append(material)
        pile.parts.append(Part(node_name, mesh["name"].text(""), len(faces)))
        pile.n_faces += len(faces)


def _no_position(primitive: Value) -> None:
    if primitive["extensions"].exists:
        for name, what in COMPRESSED.items():
            if primitive["extensions"][name].exists:
                primitive.fail("plain geometry", UNPACK, what)
    primitive["attributes"].fail("an attribute POSITION")


def _material_of(primitive: Value, looks: list[_Look]) -> int:
    """Index of a primitive's look; a default one is added where it names none."""
    if primitive["material"].exists:
        n_named = len(looks) - (1 if looks and looks[-1].material is DEFAULT else 0)
        return primitive["material"].integer(0, n_named - 1)
    if not looks or looks[-1].material is not DEFAULT:
        looks.append(_Look(DEFAULT))
    return len(looks) - 1


DEFAULT = Material("default", np.ones(3, np.float32))


def _add_vertices(
    document: Document, attributes: Value, look: _Look, T: npt.NDArray[np.float64], pile: _Pile
) -> tuple[int, int]:
    """Add the vertices of a primitive; where they begin and how many they are."""
    _refuse_unreadable(document, attributes["POSITION"])
    positions = document.values(attributes["POSITION"], ("VEC3",))
    n, offset = len(positions), pile.n_vertices
    if offset + n > 3 * MOST_FACES:
        attributes.fail(f"at most {3 * MOST_FACES} vertices in all", "Split the scene.", "too many vertices")
    uv = colour = None
    texcoord = attributes[f"TEXCOORD_{look.texcoord}"]
    if texcoord.exists:
        uv = document.values(texcoord, ("VEC2",))
        if look.A is not None and look.b is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                uv = (uv @ look.A.T + look.b).astype(np.float32)
    if attributes["COLOR_0"].exists:
        colour = _colours(document, attributes["COLOR_0"])
    for what, array in (("texture coordinates", uv), ("colours", colour)):
        if array is not None and len(array) != n:
            attributes.fail(f"one for each of the {n} vertices", found=f"{len(array)} {what}")
    pile.vertices.append(moved(positions, T))
    pile.uvs.append(uv)
    pile.colours.append(colour)
    pile.n_vertices += n
    return offset, n


def _refuse_unreadable(document: Document, reference: Value) -> None:
    """Compressed geometry has accessors without bytes, which deserve a better word than that."""
    accessor = document.accessors[reference.pick(document.accessors, "accessors")]
    if not accessor["bufferView"].exists:
        used = [entry.text() for entry in document.top["extensionsUsed"].items()]
        what = [COMPRESSED[name] for name in used if name in COMPRESSED] or ["an accessor without bytes"]
        accessor.fail("plain geometry", UNPACK, what[0])


def _colours(document: Document, reference: Value) -> npt.NDArray[np.uint8]:
    """sRGB bytes (V, 3) of linear colours of any component type; transparency is left out."""
    raw = document.accessor(reference, ("VEC3", "VEC4"))[:, :3]
    if raw.dtype.kind == "f":
        values = np.asarray(raw, np.float32)
        if not np.isfinite(values).all():
            reference.fail("finite colours", found="colours that are not finite")
        linear = np.rint(np.clip(values, 0, 1) * 65535.0).astype(np.uint16)
    elif raw.dtype == np.uint8:
        linear = np.asarray(raw, np.uint16) * np.uint16(257)
    elif raw.dtype == np.uint16:
        linear = np.asarray(raw, np.uint16)
    else:
        reference.fail("floats or unsigned integers of 8 or 16 bits", found=f"colours of type {raw.dtype}")
    return np.asarray(SRGB_OF_U16[linear], np.uint8)


def _faces(document: Document, primitive: Value, mode: int, n_vertices: int) -> npt.NDArray[np.int32]:
    """Triangles (F, 3) of a primitive, as indices of its own vertices."""
    if primitive["indices"].exists:
        raw = document.accessor(primitive["indices"], ("SCALAR",))
        if raw.dtype.kind != "u":
            primitive["indices"].fail("unsigned integers", found=f"indices of type {raw.dtype}")
        if int(raw.max()) >= n_vertices:
            found = f"a vertex index of {int(raw.max())}"
            primitive["indices"].fail(f"0..{n_vertices - 1}", "The file is damaged: fetch it again.", found)
        corners = raw.astype(np.int32)
    else:
        corners = np.arange(n_vertices, dtype=np.int32)
    if mode == TRIANGLES:
        if len(corners) % 3:
            primitive.fail("three corners for each triangle", found=f"{len(corners)} corners")
        return corners.reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int32)
    if mode == FAN:
        return np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    faces[1::2] = faces[1::2, [1, 0, 2]]
    return faces


def _looks(document: Document) -> list[_Look]:
    """Every material of the document; an image that several of them show is decoded once."""
    textures = document.top["textures"].items()
    wanted: dict[int, EncodedImage] = {}
    missing: dict[int, str] = {}
    plans = []
    for entry in document.top["materials"].items():
        factor, texture = _base_colour(entry)
        source = -1
        if texture.exists:
            reference = _image_reference(document, textures[texture["index"].pick(textures, "textures")])
            if reference is not None:
                source = reference.pick(document.images, "images")
                if source not in wanted and source not in missing:
                    image = document.image_at(source)
                    if isinstance(image.content, Path) and not image.content.is_file():
                        missing[source] = image.content.name
                    else:
                        wanted[source] = image
        plans.append((entry["name"].text("") or "material", factor, source, *_uv_plan(texture)))
    decoded = dict(zip(wanted, decode_images(list(wanted.values())), strict=True))
    looks = []
    for name, factor, source, texcoord, A, b in plans:
        colour = srgb_from_linear(np.array(factor[:3])).astype(np.float32)
        looks.append(_Look(Material(name, colour, decoded.get(source), missing.get(source, "")), texcoord, A, b))
    return looks


def _base_colour(entry: Value) -> tuple[tuple[float, ...], Value]:
    """Linear base colour factor and texture reference of a material, whichever way it states them."""
    old = entry["extensions"]
    if not entry["pbrMetallicRoughness"].exists and old.exists:
        old = old["KHR_materials_pbrSpecularGlossiness"]
        if old.exists:
            return old["diffuseFactor"].numbers(4, (1.0,) * 4), old["diffuseTexture"]
    pbr = entry["pbrMetallicRoughness"]
    if not pbr.exists:
        return (1.0,) * 4, pbr
    return pbr["baseColorFactor"].numbers(4, (1.0,) * 4), pbr["baseColorTexture"]


def _image_reference(document: Document, texture: Value) -> Value | None:
    """Which image a texture shows; None where it shows none."""
    if texture["source"].exists:
        return texture["source"]
    extensions = texture["extensions"]
    if extensions.exists:
        if extensions["KHR_texture_basisu"].exists:
            raise basis_error(document.path)
        if extensions["EXT_texture_webp"].exists:
            return extensions["EXT_texture_webp"]["source"]
    return None


def _uv_plan(texture: Value) -> tuple[int, npt.NDArray[np.float64] | None, npt.NDArray[np.float64] | None]:
    """Number of the texture coordinates and their transform (KHR_texture_transform: scale, turn, shift)."""
    if not texture.exists:
        return 0, None, None
    texcoord = texture["texCoord"].integer(0, 7, 0)
    extension = (
        texture["extensions"]["KHR_texture_transform"] if texture["extensions"].exists else texture["extensions"]
    )
    if not extension.exists:
        return texcoord, None, None
    angle = extension["rotation"].number(0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    A = turn * np.array(extension["scale"].numbers(2, (1.0, 1.0)))
    return extension["texCoord"].integer(0, 7, texcoord), A, np.array(extension["offset"].numbers(2, (0.0, 0.0)))


def _joined(pile: _Pile, materials: list[Material]) -> TexturedMesh:
    counts = [len(v) for v in pile.vertices]
    uv = colour = None
    if any(t is not None for t in pile.uvs):
        uv = np.concatenate(
            [np.zeros((n, 2), np.float32) if t is None else t for n, t in zip(counts, pile.uvs, strict=True)]
        )
    if any(c is not None for c in pile.colours):
        colour = np.concatenate(
            [np.full((n, 3), 255, np.uint8) if c is None else c for n, c in zip(counts, pile.colours, strict=True)]
        )
    face_material = np.repeat(np.array(pile.materials, np.int32), [len(f) for f in pile.faces])
    return TexturedMesh(
        np.concatenate(pile.vertices),
        np.concatenate(pile.faces),
        face_material,
        materials,
        uv,
        colour,
        tuple(pile.parts),
    )
