"""Every command that writes: how it is run on tiny inputs, what was there before, and whose files stand beside it."""

import dataclasses
import json
import os
import pathlib
import shutil
import struct
import subprocess

# Files of the user's, put beside the results and, where commands write into a folder that they share, among them.
BESIDE = {"notes.txt": "mine\n", "samples/mine.jpg": "not a picture\n", "colmap/keep.txt": "mine too\n"}
INSIDE = {"out/notes.txt": "mine\n", "out/samples/mine.jpg": "not a picture\n", "out/colmap/keep.txt": "mine too\n"}


@dataclasses.dataclass
class Case:
    argv: list
    old: list = dataclasses.field(default_factory=list)      # runs that make the old state
    again: list = None         # the run after the fault, where it is another
    foreign: dict = dataclasses.field(default_factory=lambda: dict(BESIDE))
    late: dict = dataclasses.field(default_factory=dict)     # put there after the old state was made
    needs: list = dataclasses.field(default_factory=list)    # names of inputs
    exit: int = 0              # of an undisturbed run
    grows: bool = False        # results of a stopped run are kept and continued: there is more than old and new
    steps: bool = False        # its files are published one after the other
    partial: bool = False      # exit 6 is an answer
    overwrites: bool = True    # the run may be repeated on its own results …
    repeats: bool = True       # … and then says the same
    nightly: bool = False
    weight: float = 1          # how long it takes beside the others: long ones begin first
    most: int = 1000           # places of a class at most
    without: list = dataclasses.field(default_factory=list)  # columns that make no sense
    ignore: list = dataclasses.field(default_factory=lambda: ["home/.cache"])
    measured: list = dataclasses.field(default_factory=list)  # files that hold nothing but times
    environment: dict = dataclasses.field(default_factory=dict)
    seconds: float = 120
    name: str = ""

    @property
    def needs_torch(self):
        """Run by mvstudio-avatar, which the fault library would not follow into (cli/commands.cc)."""
        return self.argv[0] in ("demo", "pose2d", "mask") or self.argv[:2] == ["tradeoff", "avatar"] or \
            self.argv[0] == "avatar" and self.argv[1] != "template"

    def foreign_paths(self):
        return {p for p in {**self.foreign, **self.late} if not str(p).endswith("/")}

    def fill(self, box, inputs, files):
        """`files`: path -> text, or `{in}/NAME`: a copy of an input."""
        for folder in ("home", "tmp"):
            (box / folder).mkdir(exist_ok=True)
        for name, text in files.items():
            target = box / name
            target.parent.mkdir(parents=True, exist_ok=True)
            source = pathlib.Path(text.replace("{in}", str(inputs))) if text.startswith("{in}") else None
            if source and source.is_dir():
                shutil.copytree(source, target, symlinks=True, dirs_exist_ok=True)
            elif source:
                shutil.copy2(source, target)
            else:
                target.write_text(text)


CASES = {}


# Commands that go on with what is there, or never replace anything: they have no --overwrite.
WITHOUT_OVERWRITE = ("report", "tradeoff ", "avatar resume", "avatar template", "dataset pack", "dataset verify")


def replacing(argv):
    """The run replaces what the one before it wrote."""
    words = argv.split() if isinstance(argv, str) else argv
    line = " ".join(words)
    return words if "--overwrite" in words or line.startswith(WITHOUT_OVERWRITE) else words + ["--overwrite"]


def case(name, argv, **more):
    CASES[name] = Case(replacing(argv), name=name, **{
        k: [w.split() for w in v] if k == "old" else v.split() if k == "again" and v else v for k, v in more.items()})


def shared_folder(name, argv, **more):
    """A command that writes single files into a folder where others may stand."""
    case(name, argv, **{"foreign": {**BESIDE, **INSIDE}, **more})


# ---- inputs ------------------------------------------------------------------------------------------------------------------

BOARD = "charuco:5x4:200mm:150mm"
SMALL_NET = "--size 32 --width 4 --downs 2 --encoder-blocks 1 --decoder-blocks 1 --no-fit-shape --validate-pictures 2"

# Name -> what makes it, in this order. Every one is a run of the program in the folder of the inputs, or a function.
INPUTS = {}


def makes(name, *runs):
    INPUTS[name] = [run.split() if isinstance(run, str) else run for run in runs]


def camera_flags(names, option, pattern):
    return " ".join(f"--{option} {name}={pattern.format(name)}" for name in names)


CAMERAS = ["cam_01", "cam_02", "cam_03"]
POSES = camera_flags(CAMERAS, "pose2d", "{{in}}/session/pose2d/take1/{}")
TAKE = camera_flags(CAMERAS, "images", "{{in}}/session/raw/take1/{}")
FOOTAGE = camera_flags(CAMERAS, "camera", "{{in}}/boards/raw/board/{}")


def project_marks(folder):
    """Marks with known places, seen by the pinhole cameras of the session's truth."""
    rig = json.loads((folder / "session/truth/calibration.json").read_text())
    places = [(x, y, z) for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (0.6, 1.0, 1.5)]
    lines = ["camera,point,x_px,y_px"]
    for camera in rig["cameras"]:
        for i, point in enumerate(places):
            x, y = project(camera, point)
            lines.append(f"{camera['name']},p{i},{x:.4f},{y:.4f}")
    (folder / "clicks.csv").write_text("\n".join(lines) + "\n")
    (folder / "places.csv").write_text("\n".join(["point,x,y,z"] + [f"p{i},{x},{y},{z}" for i, (x, y, z) in enumerate(places)]) + "\n")


def project(camera, point):
    q, t = camera["cam_from_world"]["rotation_xyzw"], camera["cam_from_world"]["translation"]
    x, y, z, w = q
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    seen = [sum(r * p for r, p in zip(row, point)) + offset for row, offset in zip(rows, t)]
    fx, fy, cx, cy = (camera["intrinsics"][k] for k in ("fx", "fy", "cx", "cy"))
    return fx * seen[0] / seen[2] + cx, fy * seen[1] / seen[2] + cy


def bump(folder):
    """The board calibration with one camera that has moved."""
    rig = json.loads((folder / "calib/calibration.json").read_text())
    rig["cameras"][1]["cam_from_world"]["translation"][0] += 0.01
    (folder / "bumped.json").write_text(json.dumps(rig))


def pickled_array(shape, values):
    """numpy's array of float64 as pickle's protocol 2 has it."""
    data = struct.pack(f"<{len(values)}d", *values)
    return (b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\nK\0\x85U\1btR(K\1("
            + b"".join(b"J" + struct.pack("<i", size) for size in shape)
            + b"tcnumpy\ndtype\n(U\2f8K\0K\1tR(K\3U\1<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89T"
            + struct.pack("<I", len(data)) + data + b"tb")


def write_model(folder):
    """A body of four vertices a joint in SMPL's layout, pickled."""
    parents = [0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
    joints, bones = len(parents), range(len(parents))
    vertices, faces = [], []
    for b in bones:
        middle = (0.1 * (b % 3 - 1), 1 - 0.05 * b, 0.01 * b)
        corners = [middle] + [tuple(middle[k] + (0.05 if k == axis else 0) for k in range(3)) for axis in range(3)]
        vertices += [x for corner in corners for x in corner]
        faces += [4 * b + i for i in (0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)]
    owner = [[float(v // 4 == b) for b in bones] for v in range(4 * joints)]
    arrays = {"v_template": ((4 * joints, 3), vertices), "f": ((4 * joints, 3), faces), "kintree_table": ((2, joints), parents + list(bones)),
              "weights": ((4 * joints, joints), sum(owner, [])),
              "J_regressor": ((joints, 4 * joints), [owner[v][b] / 4 for b in bones for v in range(4 * joints)])}
    entries = b"".join(b"U" + bytes([len(name)]) + name.encode() + pickled_array(*array) for name, array in arrays.items())
    (folder / "model.pkl").write_bytes(b"\x80\2}(" + entries + b"u.")


makes("session", "synth --out session --cameras 3 --size 96x72 --lens pinhole --board-frames 0 --take-frames 8 --samples 1 "
                 "--texture-px 16 --format png")
makes("boards", f"synth --out boards --cameras 3 --size 320x240 --board-frames 20 --take-frames 0 --samples 1 --format png "
                f"--board {BOARD} --texture-px 16")
makes("calib", f"calibrate --board {BOARD} {FOOTAGE} --model brown1 --holdout-folds 0 --warp off --stretch off --time-offset none "
               "--save-corners corners.csv --out calib", bump)
makes("marks", project_marks)
makes("model", write_model)
makes("pose3d", f"triangulate --calib session/truth/calibration.json {POSES} --method robust --out pose3d")
makes("dataset", f"dataset build --calib session/truth/calibration.json {TAKE} --pose3d pose3d --masks --mask-background-frames 4 "
                 "--out dataset --sequence test")
makes("split", "dataset split dataset --test-cameras 00_02 --test-frames 6-7 --out split.json")
makes("run", f"avatar train dataset --out run {SMALL_NET} --steps 4 --init-steps 2 --save-every 2 --holdout-cameras 00_02 "
             "--holdout-frames 6-7")
makes("scored", f"avatar train dataset --out scored {SMALL_NET} --steps 2 --init-steps 0 --holdout-cameras 00_02 --holdout-frames 6-7",
      "avatar eval scored --features gabor --pictures 1 --renders 4",
      f"avatar train dataset --out scored2 {SMALL_NET} --steps 3 --init-steps 0 --holdout-cameras 00_02 --holdout-frames 6-7 --seed 2",
      "avatar eval scored2 --features gabor --pictures 1 --renders 4")
makes("lifter", "avatar lift train dataset --out lifter.safetensors --width 32 --steps 4 --batch 16 --baseline-poses 64")

# ---- the commands ------------------------------------------------------------------------------------------------------------

case("synth png", "synth --out out --overwrite --cameras 2 --size 64x48 --board-frames 2 --take-frames 2 --samples 1 --texture-px 16 "
                  "--format png --seed 2",
     old=["synth --out out --cameras 2 --size 64x48 --board-frames 1 --take-frames 2 --samples 1 --texture-px 16 --format png"])
case("synth mp4", "synth --out out --overwrite --cameras 2 --size 64x48 --board-frames 3 --take-frames 2 --samples 1 --texture-px 16 "
                  "--seed 2",
     old=["synth --out out --cameras 2 --size 64x48 --board-frames 0 --take-frames 3 --samples 1 --texture-px 16"])
shared_folder("session init", "session init out --units cm --cameras 3 --overwrite", old=["session init out --units m --cameras 2"])
shared_folder("session init --scan", "session init out --units m --scan {in}/session/raw --fps 25 --overwrite", needs=["session"],
              old=["session init out --units m --cameras 2"], steps=True)
shared_folder("session timeline", "session timeline out --take take1 --reference cam_02", needs=["session"],
              foreign={**BESIDE, **INSIDE, "out": "{in}/session"}, old=["session timeline out --take take1 --reference cam_01"])
for _kind in ("pdf", "svg", "png"):
    shared_folder(f"board draw {_kind}", f"board draw chessboard:9x6:20mm --dpi 60 --out out/board.{_kind}",
                  old=[f"board draw chessboard:7x5:20mm --dpi 60 --out out/board.{_kind}"])
_FAST = "--holdout-folds 0 --warp off --stretch off --time-offset none"
shared_folder("calibrate --corners", f"calibrate --corners {{in}}/corners.csv --model brown2 {_FAST} --out out", needs=["calib"],
              old=[f"calibrate --corners {{in}}/corners.csv --model brown1 {_FAST} --out out"])
shared_folder("calibrate --camera", f"calibrate --board {BOARD} {FOOTAGE} --model brown2 {_FAST} --save-corners out/corners.csv "
                                    "--max-frames 8 --cache out/cache --out out", needs=["boards"], ignore=["out/cache", "home/.cache"],
              old=[f"calibrate --board {BOARD} {FOOTAGE} --model brown1 {_FAST} --save-corners out/corners.csv --max-frames 7 "
                   "--cache off --out out"], weight=4)
shared_folder("calibrate --scene-points", "calibrate --start {in}/session/truth/calibration.json --scene-points {in}/clicks.csv "
                                          "--scene-points {in}/places.csv --click-sigma-px 0.5 --out out", needs=["marks"],
              old=["calibrate --start {in}/session/truth/calibration.json --scene-points {in}/clicks.csv --scene-points "
                   "{in}/places.csv --out out"])
for _to, _out in {"mvstudio": "c.json", "panoptic": "c.json", "toml": "c.toml", "caliscope": "c.toml", "qca": "c.qca.txt", "opencv": "cv",
                  "mrcal": "cv", "colmap": "cv", "colmap-text": "cv", "nerfstudio": "transforms.json", "kalibr": "c.yaml",
                  "easymocap": "cv", "zju": "cv", "actorshq": "cv", "dna": "cv", "humman": "cv", "npz": "c.npz", "gltf": "c.glb",
                  "ply": "c.ply"}.items():
    _some = _to in ("panoptic", "opencv", "colmap", "easymocap", "dna", "gltf")
    _from = "session/truth/calibration.json" if _to in ("actorshq", "humman") else "calib/calibration.json"
    _rest = f"--to {_to} --allow-approximation 5 --out out/{_out}"
    shared_folder(f"calib convert {_to}", f"calib convert {{in}}/{_from} {_rest}", needs=["calib", "session"], nightly=not _some,
                  old=[f"calib convert {{in}}/{_from if 'truth' in _from else 'bumped.json'} {_rest} --rename cam_01=other"],
                  most=8 if not _some else 1000)
shared_folder("calib eval --repair", "calib eval {in}/bumped.json --corners {in}/corners.csv --repair out/repaired.json", exit=4,
              needs=["calib"])
shared_folder("calib refine", f"calib refine --calib {{in}}/bumped.json --corners {{in}}/corners.csv --fix lenses {_FAST} --out out",
              needs=["calib"], old=[f"calib refine --calib {{in}}/bumped.json --corners {{in}}/corners.csv --model brown1 {_FAST} --out out"])
shared_folder("calib refine --from-keypoints",
              f"calib refine --from-keypoints --calib {{in}}/session/truth/calibration.json {POSES} --keypoint-folds 2 "
              "--train-frames 0:2 --out out", needs=["session"],
              old=[f"calib refine --from-keypoints --calib {{in}}/session/truth/calibration.json {POSES} --keypoint-folds 2 "
                   "--train-frames 1:2 --out out"])
case("pose2d", f"pose2d {TAKE} --backend openpose:{{in}}/session/pose2d/take1 --overlays 1 --out out --overwrite", needs=["session"],
     old=[f"pose2d {TAKE} --backend openpose:{{in}}/session/pose2d/take1 --overlays 0 --out out"])
case("mask", f"mask {TAKE} --calib {{in}}/session/truth/calibration.json --backend background --mask-background-frames 4 "
             "--hull-frames 0 --out out --overwrite --sheet-tiles 2", needs=["session"],
     old=[f"mask {TAKE} --calib {{in}}/session/truth/calibration.json --backend background --mask-background-frames 4 --hull-frames 0 "
          "--out out --sheet-tiles 0"], weight=2)
shared_folder("sync", f"sync --calib {{in}}/session/truth/calibration.json {POSES} --min-frames 5 --fps 25 --reference cam_02 "
                      "--max-offset-frames 3 --out out", needs=["session"],
              old=[f"sync --calib {{in}}/session/truth/calibration.json {POSES} --min-frames 5 --reference cam_01 "
                   "--max-offset-frames 3 --out out"])
_TRIANGULATE = f"triangulate --calib {{in}}/session/truth/calibration.json {POSES} --holdout-points 0 --out out"
shared_folder("triangulate", f"{_TRIANGULATE} --method robust --sigma-px 1", needs=["session"], old=[f"{_TRIANGULATE} --method linear"])
shared_folder("triangulate --chunk-frames", f"{_TRIANGULATE} --method robust --chunk-frames 3", needs=["session"],
              old=[f"{_TRIANGULATE} --method linear"])
case("triangulate --session", "triangulate --session s --method robust --holdout-points 0 --calib {in}/session/truth/calibration.json",
     foreign={**BESIDE, "s": "{in}/session", "s/notes.txt": "mine\n"}, needs=["session"],
     old=["triangulate --session s --method linear --holdout-points 0 --calib {in}/session/truth/calibration.json"])
_MEASURED = ["tradeoff-*", "tradeoff_*.result.json", "trial.json"]
shared_folder("tradeoff calibrate", "tradeoff calibrate --corners {in}/corners.csv --models brown2 --views 0 10 --out out", needs=["calib"],
              weight=3, nightly=True, measured=_MEASURED)
_TRADE = f"tradeoff triangulate --calib {{in}}/session/truth/calibration.json {POSES} --precisions double --threads-list 1 --out out"
shared_folder("tradeoff triangulate", f"{_TRADE} --methods linear midpoint --views 0", needs=["session"], weight=3, nightly=True, measured=_MEASURED)
shared_folder("tradeoff pack", "tradeoff pack {in}/dataset --frames 1 --codecs raw --crops 64 --threads-list 1 --seconds 0.02 --out out",
              needs=["dataset"], weight=3, nightly=True, measured=_MEASURED)
_BUILD = (f"dataset build --calib {{in}}/session/truth/calibration.json {TAKE} --pose3d {{in}}/pose3d --mask-background-frames 4 "
          "--out out")
case("dataset build", f"{_BUILD} --masks --overwrite", needs=["pose3d"], old=[f"{_BUILD} --png"], weight=2)
case("dataset import panoptic", "dataset import panoptic {in}/dataset --out out", needs=["dataset"],
     old=["dataset import panoptic {in}/dataset --frames 2-5 --out out"])
case("dataset import panoptic decode", "dataset import panoptic {in}/dataset --pictures decode --out out", needs=["dataset"],
     partial=True)
_PACK = "dataset pack {in}/dataset --crop 32 --shard-samples 6"
case("dataset pack", f"{_PACK} --frames 0-3 --out out", old=[f"{_PACK} --frames 0-3 --out out --shard 0/2"], late=dict(INSIDE),
     needs=["dataset"], grows=True, repeats=False)
case("dataset pack --single", f"{_PACK} --frames 0-3 --codec jpeg:80 --out out --single one.h5", needs=["dataset"], grows=True,
     repeats=False)
case("dataset pack --merge", "dataset pack --out out --merge", old=[f"{_PACK} --frames 0-3 --out out --shard {i}/2" for i in (0, 1)],
     needs=["dataset"], grows=True)
shared_folder("dataset split", "dataset split {in}/dataset --test-cameras 00_01 --test-frames 5-7 --out out/split.json", needs=["dataset"],
              old=["dataset split {in}/dataset --test-cameras 00_02 --test-frames 6-7 --out out/split.json"])
shared_folder("dataset verify --keep", "dataset verify {in}/dataset --keep out", needs=["dataset"], partial=True,
              old=["dataset verify {in}/dataset --picture-step 3 --keep out"])
for _to in ("colmap", "nerfstudio", "zju", "easymocap", "actorshq", "dynamic3dgs", "dna", "humman", "trc", "c3d", "bvh", "csv", "npz",
            "gltf", "ply"):
    _some = _to in ("colmap", "zju", "dna", "csv")
    case(f"dataset export {_to}", f"dataset export {{in}}/dataset --to {_to} --out out --overwrite", needs=["dataset"],
         old=[f"dataset export {{in}}/dataset --to {_to} --frames 2 --cameras 00_00,00_01 --out out"], nightly=not _some,
         most=10 if not _some else 1000)
# Names that training writes itself, such as samples/, must be free.
_AMONG = {"out/notes.txt": "mine\n", "out/colmap/keep.txt": "mine too\n"}
_TRAIN = f"avatar train {{in}}/dataset --out out {SMALL_NET} --init-steps 0 --save-every 2 --holdout-cameras 00_02 --holdout-frames 6-7"
case("avatar train", f"{_TRAIN} --steps 3 --picture-every 3 --overwrite", foreign={**BESIDE, **_AMONG}, needs=["dataset"], grows=True, weight=6,
              old=[f"{_TRAIN} --steps 2 --seed 2"])
case("avatar resume", "avatar resume out --steps 6", needs=["run"], foreign={**BESIDE, **_AMONG, "out": "{in}/run"}, grows=True,
              weight=6, repeats=False)
_FIT = "avatar fit {in}/dataset --out out --no-surface --texture-px 8 --max-px 64 --holdout-cameras 00_02 --holdout-frames 6-7"
shared_folder("avatar fit", f"{_FIT} --overwrite", needs=["dataset"], weight=6, old=[f"{_FIT} --max-silhouettes 4"])
shared_folder("avatar template", "avatar template {in}/model.pkl --out out/model.npz", needs=["model"], overwrites=False)
_PRETRAIN = ("avatar pretrain --poses {in}/dataset:0-5 --out out --size 32 --width 4 --downs 2 --encoder-blocks 1 --decoder-blocks 1 "
             "--samples 2 --scored-samples 2 --save-every 2")
case("avatar pretrain", f"{_PRETRAIN} --steps 3 --overwrite", foreign={**BESIDE, **_AMONG}, needs=["dataset"], grows=True, weight=6,
     old=[f"{_PRETRAIN} --steps 2 --seed 2"])
shared_folder("avatar eval", "avatar eval out --features gabor --pictures 1 --renders 2", needs=["run"], weight=6,
              foreign={**BESIDE, **INSIDE, "out": "{in}/run"}, old=["avatar eval out --features gabor --pictures 2 --renders 1"])
case("avatar render", "avatar render run --cameras 00_02 --frames 6-7 --out out --overwrite", needs=["run"], weight=4,
     foreign={**BESIDE, "run": "{in}/run"}, old=["avatar render run --cameras 00_02 --frames 6 --out out"])
case("avatar render --video", "avatar render run --cameras 00_01,00_02 --frames 6-7 --video out/v.mp4 --overwrite", needs=["run"], weight=4,
     foreign={**BESIDE, **INSIDE, "run": "{in}/run"}, old=["avatar render run --cameras 00_01,00_02 --frames 6 --video out/v.mp4"])
shared_folder("avatar compare", "avatar compare {in}/scored {in}/scored2 --out out/table.md", needs=["scored"],
              old=["avatar compare {in}/scored --out out/table.md"], weight=2)
_LIFT = "avatar lift train {in}/dataset --out out/l.safetensors --width 32 --batch 16 --baseline-poses 64"
shared_folder("avatar lift train", f"{_LIFT} --steps 3", needs=["dataset"], old=[f"{_LIFT} --steps 2"], weight=3)
_APPLY = "avatar lift apply {in}/session/pose2d/take1/cam_01 --lifter {in}/lifter.safetensors --calib {in}/session/truth/calibration.json --camera cam_01 --out out"
shared_folder("avatar lift apply", f"{_APPLY} --height-m 1.7", needs=["lifter"], old=[_APPLY], weight=3, exit=6)
shared_folder("tradeoff avatar", "tradeoff avatar {in}/dataset --out out --widths 4 --sizes 32 --steps 0 2 --losses l1 --cameras 2 --features "
                                 "gabor --holdout-cameras 00_02 --train",
              needs=["dataset"], grows=True, weight=20, nightly=True, most=6, measured=_MEASURED)
CASES["tradeoff avatar"].argv.append("--downs 2 --encoder-blocks 1 --decoder-blocks 1 --no-fit-shape --validate-pictures 0")
shared_folder("report", "report out", foreign={**BESIDE, **INSIDE, "out/calib": "{in}/calib", "out/pose3d": "{in}/pose3d"},
              needs=["calib", "pose3d"], old=["report out --title before"], steps=True, without=["names"])  # the page names the run as it was given
case("report --study", "report --study {in}/scored {in}/scored2 --study-pictures 2 --out out/study.html", needs=["scored"],
     foreign={**BESIDE, **INSIDE}, old=["report --study {in}/scored {in}/scored2 --study-pictures 1 --out out/study.html"], steps=True)
case("demo --quick", "demo --quick --out out --overwrite --seed 2", old=["demo --quick --out out"], grows=True, weight=100, nightly=True, most=1,
     seconds=400, measured=["report.html", "report.json"], without=["open", "read", "close", "unlink", "link", "torn", "killafter", "pair", "tmpfs", "ro-in"])


def make_inputs(binary, folder, environment, names):
    """Makes what the cases `names` need. Returns the folder, and the cases that cannot be run here with the reason."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in ("HOME", "TMPDIR"):
        os.makedirs(environment[part], exist_ok=True)
    wanted = {need for name in names for need in CASES[name].needs}
    depends = {"marks": ["session"], "pose3d": ["session"], "calib": ["boards"], "dataset": ["pose3d", "session"], "split": ["dataset"],
               "run": ["dataset"], "scored": ["dataset"], "lifter": ["dataset", "session"]}
    while True:
        more = {d for w in wanted for d in depends.get(w, [])} - wanted
        if not more:
            break
        wanted |= more
    failed = {}
    for name in [n for n in INPUTS if n in wanted]:
        for run in INPUTS[name]:
            if callable(run):
                run(folder)
                continue
            words = [w.replace("{in}", str(folder)) for w in run]
            done = subprocess.run([str(binary), *words], cwd=folder, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                failed[name] = f"{' '.join(words)}: exit {done.returncode}: {done.stderr.strip()[-300:]}"
                break
    return folder, {name: f"its input is missing: {failed[need]}" for name in names for need in CASES[name].needs if need in failed}
