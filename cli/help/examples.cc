#include "cli/help/examples.h"

#include <string>

#include "cli/help/short_help.h"

namespace mvstudio::cli {
namespace {

struct Example {
  const char *command, *words;
};

constexpr Example kExamples[] = {
    {"demo", "--quick --out demo"},
    {"synth", "--out studio --cameras 6 --take-frames 60"},
    {"session init", "day1 --units mm --scan cards"},
    {"session show", "day1"},
    {"session trust", "day1"},
    {"run", "day1 --to triangulate"},
    {"plan", "day1 --out plan"},
    {"task", "plan 3"},
    {"jobs submit", "plan"},
    {"jobs status", "plan"},
    {"jobs retry", "plan"},
    {"session timeline", "day1 --take walk"},
    {"board propose", "--paper a3"},
    {"board draw", "charuco:8x5:24mm:18mm --paper a4 --out board.pdf"},
    {"board check", "board.mp4"},
    {"calibrate", "--board charuco:8x5:24mm:18mm --camera cam1=cam1.mp4 --camera cam2=cam2.mp4 --out calib"},
    {"calib convert", "calib/calibration.json --to opencv --out opencv"},
    {"calib show", "calib/calibration.json"},
    {"calib compare", "today/calibration.json calib/calibration.json"},
    {"calib eval", "calib/calibration.json --board charuco:8x5:24mm:18mm --camera cam1=a.mp4 --camera cam2=b.mp4 --out check"},
    {"calib refine", "--calib calib/calibration.json --from-keypoints --session day1 --out refined"},
    {"calib align", "calib/calibration.json --floor-joints pose3d --out level.json"},
    {"calib click", "--points points.csv --camera cam1=cam1.png --out clicked.csv"},
    {"calib resize", "calib/calibration.json --size 960x540 --out half.json"},
    {"calib lenses add", "lenses.json calib/calibration.json --camera cam1 --serial 22456013"},
    {"calib lenses list", "lenses.json"},
    {"calib lenses check", "lenses.json"},
    {"models fetch", ""},
    {"models list", ""},
    {"pose2d", "--session day1 --take walk"},
    {"mask", "--session day1 --take walk"},
    {"sync", "--session day1 --take walk"},
    {"triangulate", "--session day1 --take walk --to trc,c3d"},
    {"error-budget", "--session studio"},
    {"markers", "pose3d --to trc,c3d --frame-rate 60 --out markers"},
    {"markers convert", "pose3d --out walk.c3d --frame-rate 60"},
    {"markers angles", "pose3d --frame-rate 60 --out angles"},
    {"markers events", "pose3d --frame-rate 60 --out events"},
    {"tradeoff all", "--quick --out tradeoffs.html"},
    {"tradeoff calibrate", "--board charuco:8x5:24mm:18mm --camera cam1=cam1.mp4 --camera cam2=cam2.mp4 --out speed"},
    {"tradeoff triangulate", "--calib calib/calibration.json --pose2d cam1=pose2d/cam1 --pose2d cam2=pose2d/cam2"},
    {"tradeoff pack", "dataset --out speed"},
    {"tradeoff predictions", "session --out predictions"},
    {"tradeoff avatar", "dataset --quick --out tradeoff"},
    {"dataset build", "--session day1 --take walk"},
    {"dataset import panoptic", "171204_pose1 --out day1"},
    {"dataset pack", "dataset --crop 256 --out pack"},
    {"dataset split", "dataset --holdout-cameras cam2,cam7 --holdout-frames 90-119 --out split.json"},
    {"dataset export", "dataset --to nerfstudio --out nerfstudio"},
    {"dataset verify", "dataset"},
    {"dataset info", "dataset"},
    {"avatar template", "mannequin"},
    {"avatar mesh", "body --out meshes"},
    {"avatar fit", "dataset --out body"},
    {"avatar texture", "avatar --out recoloured"},
    {"avatar edit", "body --picture painted.png --out painted"},
    {"avatar pretrain", "--poses dataset --out pretrained"},
    {"avatar pretrain-renderer", "anna_avatar ben_avatar --out renderer"},
    {"avatar train", "dataset --holdout-cameras cam2 --holdout-frames 90-119 --out avatar"},
    {"avatar resume", "avatar --steps 2000"},
    {"avatar info", "avatar"},
    {"avatar eval", "avatar"},
    {"avatar compare", "avatar gaussians --out table.md"},
    {"avatar lift train", "dataset --out lifter.safetensors"},
    {"avatar lift apply", "pose2d/cam1 --lifter lifter.safetensors --calib calib/calibration.json --camera cam1 --out lifted"},
    {"avatar render", "avatar --turntable 48 --video turn.mp4"},
    {"avatar surface", "body/body.npz --truth studio"},
    {"metrics", "truth render"},
    {"report", "day1"},
    {"view", "day1"},
    {"render overlay", "day1 --out overlay"},
    {"doctor", "day1"},
    {"version", ""},
};

}  // namespace

void AddExamples(CLI::App& app) {
  for (const Example& example : kExamples) {
    CLI::App* command = CommandNamed(app, example.command);
    if (!command) continue;  // needs libtorch, and this program has none
    const std::string words = example.words;
    command->footer("Example: mvstudio " + std::string(example.command) + (words.empty() ? "" : " ") + words);
  }
}

}  // namespace mvstudio::cli
