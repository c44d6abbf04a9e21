"""What people want in a room and what they put on things: tuples of kinds, of which a home takes those that it can have."""

from __future__ import annotations

SINKS = ("kitchen sink", "washbasin")
HOT = ("stove", "double oven", "oven")
FRIDGE = ("refrigerator",)
SOFAS = ("sofa", "corner sofa", "loveseat", "futon", "sofa bed")
PLANTS = ("potted plant", "ficus", "yucca", "peace lily", "spider plant", "palm", "snake plant", "bamboo plant")
SMALL_PLANTS = (
    "potted plant", "bonsai", "cactus", "orchid", "succulent", "flowers", "tulips", "lilies", "bamboo plant",
)  # fmt: skip
SIDEBOARD = (
    "vase", "radio", "candle", "photo frame", "speaker dock", "stereo", "aquarium", "cat statue", "deer figurine", "bowl",
    "cordless phone", "camera", "fan", "jar", "helmet", "toy car", "figurine", "globe", "table lamp", "bowl of fruit",
    "wine bottle", "teapot", "tray", "basket", "phone", "table clock", "record player",
)  # fmt: skip
DRESSER = (
    "vase", "hat", "handbag", "photo frame", "folded clothes", "candle", "cap", "briefcase", "jewelry box", "table lamp",
    "mirror", "box", "bottle", "basket", "stereo", "teddy bear", "figurine",
)  # fmt: skip
TOYS = (
    "teddy bear", "toy car", "toy train", "toy plane", "toy", "doll", "soccer ball", "basketball", "puzzle", "xylophone",
    "rubik's cube", "rocking horse", "dollhouse", "tricycle", "skateboard", "ball", "building blocks", "toy blocks", "robot",
)  # fmt: skip
FLOOR_FINDS = (
    "suitcase", "laundry basket", "slippers", "sneakers", "shoes", "backpack", "fan", "basket", "cardboard box", "safe",
    "handbag", "gift box", "electric guitar", "guitar", "box",
)  # fmt: skip
SEATS = ("armchair", "bean bag", "bench", "ottoman", "recliner", "chair", "stool")
# What people put where a wall is still bare.
FILLERS: tuple[tuple[str, ...], ...] = (
    ("bookcase", "shelves", "cabinet"),
    ("armchair", "bench", "recliner"),
    ("sideboard", "console table", "chest of drawers"),
    PLANTS,
    ("floor lamp", "basket", "speaker", "trunk", "ottoman"),
    ("desk", "piano", "bookcase", "cabinet"),
    ("side table", "stool", "potted plant"),
)
# What each kind of room must have: one of every row.
NEEDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "living room": (SOFAS, ("television", "wall television", "entertainment center")),
    "studio": (("bed", "day bed"), SINKS, HOT),
    "kitchen": (SINKS, HOT, FRIDGE),
    "bedroom": (("bed", "day bed", "captain's bed", "sofa bed"), ("wardrobe", "cupboard", "clothes rack")),
    "children's room": (("child bed", "bunk bed", "crib", "captain's bed", "day bed", "bed"),),
    "bathroom": (
        ("toilet",), ("washbasin", "vanity", "double vanity"), ("bathtub", "corner bathtub", "shower stall", "shower"),
    ),
    "office": (("desk",),),
    "dining room": (("dining table", "round table", "folding table"),),
    "laundry room": (("washing machine", "dryer"),),
    "hall": (),
}  # fmt: skip
