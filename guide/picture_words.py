"""The words in pictures, in every language of the guide."""

from __future__ import annotations

from collections.abc import Mapping

LANGUAGES = ("en", "ja")

LABELS: Mapping[str, tuple[str, str]] = {
    "from-back": ("seen from the back of the hand", "手背側から"),
    "from-palm": ("seen from the palm", "手掌側から"),
    "from-thumb": ("seen from the thumb's side", "母指側から"),
    "movement-flat": ("Flat hand", "平らな手"),
    "movement-flat-how": (
        "A right hand lies flat and still, the fingers a little apart.",
        "右手を平らにして静止させ、指を少し開く。",
    ),
    "movement-knuckles": ("Knuckles", "MCP関節"),
    "movement-knuckles-how": (
        "All fingers bend at their knuckles (MCP joints), then are drawn back, the rest of the finger "
        "straight.",
        "全指をMCP関節だけで屈曲し、次に反らす。ほかの関節は伸ばしたままにする。",
    ),
    "movement-hook": ("Hook", "鉤握り"),
    "movement-hook-how": (
        "The fingers' middle and tip joints (PIP and DIP) bend to a hook and stretch, the knuckles "
        "stay straight.",
        "MCP関節を伸ばしたまま、PIP関節とDIP関節を鉤形に曲げて伸ばす。",
    ),
    "movement-fingertips": ("Fingertip joints alone", "DIP関節だけ"),
    "movement-fingertips-how": (
        "Only the last joint (DIP) of each finger bends and stretches, all others are held.",
        "各指のDIP関節だけを屈曲・伸展し、ほかの関節は動かさない。",
    ),
    "movement-fist": ("Fist", "握りこぶし"),
    "movement-fist-how": (
        "The fingers close to a fist, all their joints together, and open again.",
        "指の全関節を同時に曲げてこぶしを作り、また開く。",
    ),
    "movement-alone": ("One finger after the other", "一指ずつ"),
    "movement-alone-how": (
        "Index, middle, ring and little finger bend in turn, each alone.",
        "示指、中指、環指、小指を一本ずつ順に曲げる。",
    ),
    "movement-spread": ("Spread", "外転と内転"),
    "movement-spread-how": (
        "The straight fingers are spread apart and brought together.",
        "伸ばした指を開き（外転）、閉じる（内転）。",
    ),
    "movement-thumb-circle": ("Thumb circle", "母指の分回し"),
    "movement-thumb-circle-how": (
        "The thumb draws a circle from its base (CMC joint), as large as it can be.",
        "母指をCMC関節から、できるだけ大きな円を描くように回す。",
    ),
    "movement-thumb-bend": ("Thumb, joint by joint", "母指の屈曲"),
    "movement-thumb-bend-how": (
        "The thumb bends at its middle joint (MCP), then at its tip joint (IP) alone.",
        "母指をMCP関節で、次にIP関節だけで曲げる。",
    ),
    "movement-opposition": ("Opposition", "対立"),
    "movement-opposition-how": (
        "The thumb's pad touches the pads of index, middle, ring and little finger in turn.",
        "母指の指腹で、示指、中指、環指、小指の指腹に順に触れる。",
    ),
    "movement-cup": ("Cup the palm", "手掌をくぼませる"),
    "movement-cup-how": (
        "The hand closes round a ball and opens: the palm cups at the CMC joints of the ring and the "
        "little finger.",
        "ボールを包むように手を閉じて開く。環指と小指のCMC関節で手掌がくぼむ。",
    ),
    "movement-wrist-bend": ("Wrist, bend and stretch", "手関節の屈曲と伸展"),
    "movement-wrist-bend-how": ("The wrist bends and stretches.", "手関節を屈曲し、伸展する。"),
    "movement-wrist-sideways": ("Wrist, sideways", "手関節の橈屈と尺屈"),
    "movement-wrist-sideways-how": (
        "The wrist moves sideways, towards the thumb and towards the little finger.",
        "手関節を母指側（橈屈）と小指側（尺屈）へ動かす。",
    ),
    "receivers": ("Sixteen receivers on a right hand", "右手の16個のレシーバ"),
    "receivers-how": (
        "The back of a right hand. A receiver sits on the back of the hand, three on the thumb and "
        "three on each finger, on the middle of each bone and on each nail; all cables run to the "
        "forearm. Each has the number of its tracker station. A receiver's x axis points to the "
        "fingertip, y to the thumb, z away from the skin.",
        "右手の手背。手背に1個、母指に3個、各指に3個のレシーバがあり、骨の中央と爪の上に着ける。ケ"
        "ーブルはすべて前腕へ向かう。番号はトラッカーのステーション番号。レシーバのx軸は指先、y軸は"
        "母指側、z軸は皮膚から離れる向き。",
    ),
    "which-way-round": ("Which way round a receiver sits", "レシーバの向き"),
    "which-way-round-how": (
        "Four fingers, each with a receiver. Right: on the middle of the bone, x to the fingertip, "
        "cable to the wrist. Wrong: back to front, sideways, or over a joint.",
        "レシーバを着けた4本の指。正しい例：骨の中央、x軸は指先、ケーブルは手関節へ。誤った例：前後"
        "逆、横向き、関節の上。",
    ),
    "way-right": ("right", "正しい"),
    "way-turned": ("back to front", "前後が逆"),
    "way-sideways": ("sideways", "横向き"),
    "way-on-joint": ("over a joint", "関節の上"),
    "receivers-from-the-side": ("A finger from its side", "横から見た指"),
    "receivers-from-the-side-how": (
        "An index finger from the thumb's side. Receivers lie on the middle of the back of each bone, "
        "none over a joint; each cable makes a loose arc over the joints behind it.",
        "母指側から見た示指。レシーバは各骨の背側の中央にあり、関節の上にはない。ケーブルは関節の上で"
        "たるませる。",
    ),
    "slack": ("a loose arc of cable over each joint", "関節ごとにケーブルをたるませる"),
    "joint-free": ("no receiver and no tape over a joint", "関節の上にレシーバやテープを置かない"),
    "segment-hand": ("back of the hand", "手背"),
    "segment-thumb_metacarpal": ("thumb, metacarpal", "母指中手骨"),
    "segment-thumb_proximal": ("thumb, proximal phalanx", "母指基節骨"),
    "segment-thumb_distal": ("thumb, distal phalanx", "母指末節骨"),
    "segment-index_proximal": ("index, proximal phalanx", "示指基節骨"),
    "segment-index_middle": ("index, middle phalanx", "示指中節骨"),
    "segment-index_distal": ("index, distal phalanx", "示指末節骨"),
    "segment-middle_proximal": ("middle, proximal phalanx", "中指基節骨"),
    "segment-middle_middle": ("middle, middle phalanx", "中指中節骨"),
    "segment-middle_distal": ("middle, distal phalanx", "中指末節骨"),
    "segment-ring_proximal": ("ring, proximal phalanx", "環指基節骨"),
    "segment-ring_middle": ("ring, middle phalanx", "環指中節骨"),
    "segment-ring_distal": ("ring, distal phalanx", "環指末節骨"),
    "segment-little_proximal": ("little, proximal phalanx", "小指基節骨"),
    "segment-little_middle": ("little, middle phalanx", "小指中節骨"),
    "segment-little_distal": ("little, distal phalanx", "小指末節骨"),
    "room": ("The room, from above", "計測室を上から見た図"),
    "room-how": (
        "A plan. On a wooden table stands the transmitter, the hand about 30 cm from it in the "
        "direction of its x axis. A dashed circle of 90 cm around the transmitter: within it the "
        "tracker is as accurate as specified. A steel cabinet, a computer and a motor stand outside "
        "of it.",
        "平面図。木製の机の上にトランスミッタがあり、手はそのx軸の方向に約30 cm離れている。破線"
        "は半径90 cmの円で、この中では仕様どおりの精度が得られる。金属製の棚、計算機、モータは円"
        "の外に置く。",
    ),
    "transmitter": ("transmitter", "トランスミッタ"),
    "wooden-table": ("table without steel", "金属のない机"),
    "about-30": ("30 cm", "30 cm"),
    "as-specified": ("90 cm", "90 cm"),
    "steel": ("steel", "鉄製の棚"),
    "computer": ("computer", "計算機"),
    "motor": ("motor", "モータ"),
    "hemisphere": ("The tracker's half of space", "トラッカーの半球"),
    "hemisphere-how": (
        "A transmitter and the plane through it, across its x axis. The hand stays on the side of +x. "
        "If it crosses the plane, the tracker reports it on the opposite side of the transmitter, "
        "turned as before.",
        "トランスミッタと、そのx軸に垂直な面。手は常に+xの側に置く。面を越えると、トラッカーは手が"
        "トランスミッタの反対側に同じ向きであると報告する。",
    ),
    "here": ("the hand stays here", "手はこちら側に置く"),
    "not-here": ("reported here after a flip", "反転時の報告位置"),
    "rigid-pair": ("Two receivers on a stick", "棒に付けた2個のレシーバ"),
    "rigid-pair-how": (
        "Two receivers on a wooden stick, moved through the space in which the hand will be. Their "
        "distance must stay.",
        "木の棒に2個のレシーバを固定し、手を動かす空間全体で動かす。両者の距離は一定のはずである。",
    ),
    "same-distance": ("always the same distance", "距離は常に一定"),
}


def label(key: str, language: str) -> str:
    """The words of a label. Raises KeyError where there is none."""
    return LABELS[key][LANGUAGES.index(language)]
