#include <algorithm>
#include <fstream>
#include <regex>
#include <set>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// Nothing is not a score: inputs that share no camera, frame, joint, person or image, and sets that are empty, end every
/// command with an exit code that is not 0 and a line that names what does not match. No figure is printed of them.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

struct Row {
  std::string command;
  int exit;
  std::string words;  ///< after the command, between spaces; P2D/ stands for --pose2d of each folder in P2D
  std::string part;   ///< of what is said
};

/// In the sandbox: `studio`, a session of three cameras and its `dataset`; `rig.json`; `other.json` with other names,
/// `two.json` without cam_03, `one.json` with cam_01 alone. 2D joints: `joints`, `names` (other cameras), `frames` (none in
/// common), `nobody`. 3D joints: `points`, `late` (other frames), `called` (other names), `nopoints`. Datasets: `bare` (no
/// images), `empty` (nobody), `apart` (joints of other frames). `a`, `b`: images without a common name; `none`: an empty
/// folder.
const Row kRows[] = {
    {"calib compare", 2, "rig.json other.json", "no camera name is in both"},
    {"calib compare", 6, "rig.json two.json", "cam_03"},
    {"calib compare", 6, "rig.json one.json", "one camera alone is in both"},
    {"calib compare", 4, "rig.json one.json --max-rotation-deg 1", "rotation_deg cannot be checked"},
    {"calib compare", 4, "rig.json small.json", "the lenses of no camera can be compared"},
    {"calib eval", 3, "other.json --corners corners.csv --board grid:4x3:100mm", "x01"},
    {"calib eval", 4, "two.json --corners corners.csv --board grid:4x3:100mm", "cam_03"},
    {"calib eval", 5, "rig.json --corners alone.csv --board grid:4x3:100mm", "no two cameras see a board"},
    {"calibrate", 3, "--corners header.csv --board grid:4x3:100mm --out new", "header.csv"},
    {"calibrate", 5, "--corners apart.csv --board grid:4x3:100mm --out new --model pinhole", "cam_0"},
    {"tradeoff calibrate", 5, "--corners apart.csv --board grid:4x3:100mm --models pinhole --views 0", "no way to calibrate"},
    {"sync", 3, "--calib rig.json names/ --out new", "cam_01, cam_02, cam_03"},
    {"sync", 5, "--calib rig.json frames/ --out new", "too few frames with joints that another camera sees"},
    {"sync", 5, "--calib rig.json nobody/ --out new", "too few frames"},
    {"triangulate", 3, "--calib rig.json names/ --out new", "cam_01, cam_02, cam_03"},
    {"triangulate", 5, "--calib rig.json frames/ --out new", "no joint is seen by 2 cameras in one frame"},
    {"triangulate", 5, "--calib rig.json nobody/ --out new", "no joint is seen by 2 cameras in one frame"},
    {"triangulate", 4, "--calib rig.json joints/ --out new --truth late", "no frame is in both"},
    {"triangulate", 4, "--calib rig.json joints/ --out new --truth called", "no joint has a name of the reference's"},
    {"triangulate", 4, "--calib rig.json joints/ --out new --truth nopoints", "the reference holds no point"},
    {"error-budget", 5, "--calib rig.json frames/ --out new", "no joint is seen by 3 cameras in one frame"},
    {"error-budget", 5, "--calib rig.json nobody/ --out new", "no joint is seen by 3 cameras in one frame"},
    {"error-budget", 4, "--calib rig.json joints/ --out new --truth late --truth-calib rig.json",
     "no joint of the take has a true one"},
    {"error-budget", 4, "--calib rig.json joints/ --out new --truth called --truth-calib rig.json",
     "no joint of the take has a true one"},
    {"error-budget", 3, "--calib rig.json joints/ --out new --truth points --truth-calib two.json", "cam_03"},
    {"tradeoff triangulate", 5, "--calib rig.json frames/", "no joint is seen by 2 cameras in one frame"},
    {"tradeoff triangulate", 5, "--calib rig.json nobody/", "no joint is seen by 2 cameras in one frame"},
    {"tradeoff triangulate", 4, "--calib rig.json joints/ --truth late --methods linear --views 0", "no frame is in both"},
    {"tradeoff triangulate", 4, "--calib rig.json joints/ --truth called --methods linear --views 0", "no joint has a name"},
    {"markers", 3, "nopoints --out new --to csv --frame-rate 25", "no joint of anybody has a position"},
    {"markers angles", 3, "nopoints --out new", "no joint of anybody has a position"},
    {"markers events", 3, "nopoints --out new", "no joint of anybody has a position"},
    {"markers convert", 3, "nopoints --out new --to trc", "no point of anybody has a position"},
    {"mask", 4, "--calib rig.json --pose3d late --video cam_01=studio/raw/take1/cam_01.mp4 --out new --no-hull",
     "frames 90 to 92"},
    {"dataset build", 3, "--session studio --calib other.json --pose3d points --out new", "cam_01, cam_02, cam_03"},
    {"dataset build", 6, "--session studio --calib two.json --pose3d points --out new --no-masks", "cam_03"},
    {"dataset build", 3, "--session studio --calib rig.json --pose3d late --out new", "frame 90"},
    {"dataset build", 3, "--session studio --calib rig.json --pose3d nopoints --out new", "nopoints"},
    {"dataset build", 4, "--session studio --calib rig.json --pose3d dataset/hdPose3d_stage1_coco19 --out new --frames 900",
     "has no frame 900; it has"},
    {"dataset build", 4, "--session studio --calib rig.json --pose3d points --out new --frames 900-910",
     "points has no frames 900 to 910; it has"},
    {"dataset pack", 4, "dataset --crop 32 --out new --frames 900-910", "dataset has no frames 900 to 910; it has"},
    {"dataset export", 4, "dataset --to trc --out new --frames 900-910", "has no frames 900 to 910; it has"},
    {"dataset split", 4, "dataset --test-cameras 00_02 --test-frames 900-910 --out new", "has no frames 900 to 910; it has"},
    {"markers convert", 4, "points --out new --to trc --frame-rate 25 --frames 900-910", "has no frames 900 to 910; it has"},
    {"triangulate", 4, "--calib rig.json joints/ --out new --frames 900-910", "has no frames 900 to 910; it has"},
    {"mask", 4, "--calib rig.json --video cam_01=studio/raw/take1/cam_01.mp4 --out new --frames 900-910",
     "the footage has no frames 900 to 910; it has"},
    {"avatar fit", 4, "dataset --out new --frames 900-910", "has no frames 900 to 910; it has"},
    {"dataset verify", 6, "empty", "nobody is in any of its 3 frames"},
    {"dataset verify", 6, "apart", "no image for any of 3 frames with joints"},
    {"dataset split", 4, "empty --test-cameras 00_02 --holdout-frames 2 --out new", "nobody has joints in both"},
    {"dataset split", 3, "bare --test-cameras 00_02 --test-frames 2 --out new", "holds no images of any camera"},
    {"dataset split", 2, "dataset --holdout-cameras 00_07 --out new", "00_00, 00_01, 00_02"},
    {"dataset pack", 3, "apart --crop 32 --out new", "none of the 3 pictures"},
    {"dataset pack", 3, "bare --crop 32 --out new", "holds no images of any camera"},
    {"dataset pack", 2, "empty --crop 32 --out new", "no camera sees a person"},
    {"tradeoff all", 3, "--session none --out new.html", "holds no mvstudio.toml"},
    {"tradeoff predictions", 2, "none", "no predictions.jsonl is there"},
    {"tradeoff pack", 2, "empty --out new", "no camera sees a person"},
    {"dataset export", 3, "apart --to colmap --out new", "none of the 3 images"},
    {"dataset export", 3, "empty --to csv --out new", "hold nobody's joints"},
    {"dataset export", 4, "empty --to npz --out new", "nobody's joints"},
    {"dataset import panoptic", 4, "empty --out new", "nobody is in any of the 3 frames"},
    {"avatar train", 3, "empty --steps 0 --size 32 --out new", "no frame has a person"},
    {"avatar train", 3, "packed --out new", "is a pack"},
    {"avatar train", 2, "dataset --size 32 --out new --holdout-cameras gopro9", "it has cam_01, cam_02, cam_03"},
    {"avatar train", 4, "dataset --size 32 --out new --holdout-frames 300-301",
     "has no frames 300 to 301; it has 3 frames from 0 to 2"},
    {"avatar fit", 2, "dataset --out new --test-cameras gopro9", "it has cam_01, cam_02, cam_03"},
    {"avatar fit", 3, "empty --out new", "no frame has a person"},
    {"tradeoff avatar", 3, "empty --out new --quick --holdout-cameras 00_02", "no frame has a person"},
    {"tradeoff avatar", 2, "dataset --out new --quick --test-cameras gopro9", "it has cam_01, cam_02, cam_03"},
    {"tradeoff avatar", 2, "dataset --out new --quick --holdout-cameras 00_02 --holdout-frames 300", "its frames: 0 to 2"},
    {"avatar surface", 3, "none/body.npz --truth studio", "none/body.npz"},
    {"avatar compare", 3, "none", "none/avatar_eval.result.json"},
    {"avatar eval", 3, "none", "none"},
    {"metrics", 3, "a b", "no image has the name of one"},
    {"metrics", 3, "a none", "holds no PNG or JPEG images"},
    {"metrics", 6, "a c", "MET-UNMATCHED"},
    {"metrics", 3, "a b --distance-only", "needs at least 4 images"},
    {"metrics", 3, "a a --masks b", "has no mask called"},
    {"report", 3, "none", "nothing to report here"},
    {"view", 3, "none", "nothing to show"},
    {"render overlay", 2, "none --out new", "nothing is drawn"},
    {"run", 3, "none", "holds no mvstudio.toml"},
    {"plan", 3, "none --out new", "holds no mvstudio.toml"},
    {"task", 2, "none 1", "holds no plan.jsonl"},
    {"jobs submit", 2, "none", "holds no plan.jsonl"},
    {"jobs status", 2, "none", "holds no plan.jsonl"},
    {"jobs retry", 2, "none", "holds no plan.jsonl"},
    {"report", 3, "studio --with none --out new", "nothing to report here"},
    {"report", 3, "studio none", "nothing to report here"},
    {"report", 3, "--study a b --truth a --out new", "no file name in common"},
    {"session show", 3, "none", "holds no mvstudio.toml"},
    {"session trust", 3, "none", "holds no mvstudio.toml"},
    {"session timeline", 6, "short --out new", "cam_03"},
    {"doctor", 3, "none", "no footage was found"},
    {"board check", 3, "studio/raw/plate/cam_01.png", "no board that was tried is in any of the images"},
};

/// Commands that set nothing beside anything else, or whose tests of this kind need a trained network.
const char* const kElsewhere[] = {"demo",
                                  "synth",
                                  "session init",
                                  "board propose",
                                  "board draw",
                                  "calib convert",
                                  "calib show",
                                  "calib refine",
                                  "calib align",
                                  "calib click",
                                  "calib resize",
                                  "calib lenses add",
                                  "calib lenses list",
                                  "calib lenses check",
                                  "models fetch",
                                  "pose2d",
                                  "models list",
                                  "dataset info",
                                  "avatar template",
                                  "avatar mesh",
                                  "avatar texture",
                                  "avatar edit",
                                  "avatar pretrain",
                                  "avatar pretrain-renderer",
                                  "avatar resume",
                                  "avatar info",
                                  "avatar lift train",
                                  "avatar lift apply",
                                  "avatar render",
                                  "version"};

void Write(const std::string& path, const std::string& text) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path) << text;
}

nlohmann::json Read(const std::string& path) { return nlohmann::json::parse(Slurp(path)); }

/// The commands, as the page lists them that scripts/cli-docs makes of the program's help.
std::set<std::string> Commands() {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  std::istringstream lines(Slurp(std::string(source ? source : ".") + "/docs/cli.md"));
  const std::string heading = "### mvstudio ";
  std::set<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(heading, 0) == 0) names.insert(line.substr(heading.size()));
  }
  return names;
}

class NothingInCommon : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    sandbox_ = std::make_unique<TempDir>();
    const CliRun made =
        In({"synth", "--out", "studio", "--cameras", "3", "--size", "320x240", "--board-frames", "4", "--take-frames", "3"});
    ASSERT_EQ(made.exit, 0) << made.err;
    const CliRun built = In({"dataset", "build", "--session", "studio", "--calib", "studio/truth/calibration.json", "--pose3d",
                             "studio/truth/pose3d", "--out", "dataset"});
    ASSERT_EQ(built.exit, 0) << built.err;
    MakeRigs();
    MakeJoints();
    MakeDatasets();
    MakeCorners();
    MakeImages();
  }
  static void TearDownTestSuite() { sandbox_.reset(); }

  static CliRun In(const std::vector<std::string>& words) { return RunCli(words, "cd " + sandbox_->path() + " && "); }
  static std::string At(const std::string& name) { return *sandbox_ / name; }

  static void MakeRigs() {
    nlohmann::json rig = Read(At("studio/truth/calibration.json"));
    rig.erase("joint_covariance_lower");
    Write(At("rig.json"), rig.dump());
    nlohmann::json small = rig, other = rig, two = rig, one = rig;
    for (auto& camera : small["cameras"]) camera["size_px"] = {300, 240};
    for (auto& camera : other["cameras"]) camera["name"] = "x" + camera["name"].get<std::string>().substr(4);
    two["cameras"].erase(2), one["cameras"].erase(2), one["cameras"].erase(1);
    Write(At("small.json"), small.dump()), Write(At("other.json"), other.dump());
    Write(At("two.json"), two.dump()), Write(At("one.json"), one.dump());
  }

  static void MakeJoints() {
    for (int c = 1; c <= 3; ++c) {
      const std::string name = "cam_0" + std::to_string(c), from = At("studio/pose2d/take1/" + name);
      fs::create_directories(At("joints")), fs::create_directories(At("names"));
      fs::copy(from, At("joints/" + name)), fs::copy(from, At("names/x0" + std::to_string(c)));
      for (int f = 0; f < 3; ++f) {
        const auto file = [](int frame) { return std::string("/00000000") + std::to_string(1000 + frame) + "_keypoints.json"; };
        const std::string text = Slurp(from + "/00000000000" + std::to_string(f) + "_keypoints.json");
        ASSERT_FALSE(text.empty());
        Write(At("frames/" + name + file(100 * c + f)), text);
        nlohmann::json nobody = nlohmann::json::parse(text);
        nobody["people"] = nlohmann::json::array();
        Write(At("nobody/" + name + file(f)), nobody.dump());
      }
    }
    const std::string points = Slurp(At("studio/truth/pose3d/points.csv")), head = Slurp(At("studio/truth/pose3d/pose3d.json"));
    const std::string columns = points.substr(0, points.find('\n') + 1), rows = points.substr(columns.size());
    for (const char* name : {"points", "late", "called", "nopoints"}) Write(At(std::string(name) + "/pose3d.json"), head);
    Write(At("points/points.csv"), points), Write(At("nopoints/points.csv"), columns);
    Write(At("late/points.csv"), columns + std::regex_replace(rows, std::regex("(^|\n)([0-9])"), "$019$2"));
    Write(At("called/points.csv"), columns + std::regex_replace(rows, std::regex("(^|\n)([0-9],[0-9]),"), "$01$2,Q"));
  }

  static void MakeDatasets() {
    for (const char* name : {"bare", "empty", "apart"}) fs::copy(At("dataset"), At(name), fs::copy_options::recursive);
    fs::remove_all(At("bare/hdImgs")), fs::create_directory(At("bare/hdImgs"));
    for (int f = 0; f < 3; ++f) {
      for (const char* folder : {"/hdPose3d_stage1_coco19", "/hdPose3d_stage1_body25"}) {
        const std::string scene = std::string(folder) + "/body3DScene_0000000" + std::to_string(f) + ".json";
        nlohmann::json json = Read(At("empty" + scene));
        json["bodies"] = nlohmann::json::array();
        Write(At("empty" + scene), json.dump());
        fs::rename(At("apart" + scene),
                   At(std::string("apart") + folder + "/body3DScene_0000030" + std::to_string(f) + ".json"));
      }
    }
    Write(At("packed/shard-00000.h5"), "");
    fs::copy(At("studio"), At("short"), fs::copy_options::recursive);
    const std::string toml = Slurp(At("short/mvstudio.toml"));
    Write(At("short/mvstudio.toml"), std::regex_replace(toml, std::regex("\"cam_03\" = \"raw/take1/cam_03.mp4\"\n"), ""));
  }

  /// Boards of 4 x 3 corners that face the camera squarely: they fit any camera by themselves.
  static void MakeCorners() {
    const std::string columns =
        "# mvstudio corners 1\n# camera 320x240 cam_01\n# camera 320x240 cam_02\n# camera 320x240 "
        "cam_03\ncamera,frame,board,corner,x_px,y_px\n";
    std::string same, apart;
    for (int c = 1; c <= 3; ++c) {
      for (int i = 0; i < 12; ++i) {
        const std::string corner = ",0," + std::to_string(i) + "," + std::to_string(60 + 40 * (i % 4)) + "," +
                                   std::to_string(60 + 40 * (i / 4)) + "\n";
        same += "cam_0" + std::to_string(c) + ",0" + corner;
        apart += "cam_0" + std::to_string(c) + "," + std::to_string(100 * c) + corner;
      }
    }
    Write(At("corners.csv"), columns + same), Write(At("apart.csv"), columns + apart);
    Write(At("header.csv"), columns), Write(At("alone.csv"), columns + same.substr(0, same.find("cam_02")));
  }

  static void MakeImages() {
    fs::create_directory(At("none"));
    const std::string from = At("dataset/masks/00_00/00_00_0000000");
    for (const char* folder : {"a", "b", "c"}) fs::create_directory(At(folder));
    for (int f = 0; f < 3; ++f) {
      const std::string own = std::to_string(f) + ".png";
      fs::copy(from + own, At("a/a" + own)), fs::copy(from + own, At("b/b" + own));
      if (f < 2) fs::copy(from + own, At("c/a" + own));
    }
  }

  static std::unique_ptr<TempDir> sandbox_;
};
std::unique_ptr<TempDir> NothingInCommon::sandbox_;

std::vector<std::string> Words(const Row& row, size_t number, const TempDir& sandbox) {
  std::istringstream in(row.command + " " + row.words);
  std::vector<std::string> words;
  for (std::string word; in >> word;) {
    if (word == "new") word += std::to_string(number);
    if (word.back() != '/') {
      words.push_back(word);
      continue;
    }
    for (const auto& entry : fs::directory_iterator(sandbox / word)) {
      words.push_back("--pose2d");
      words.push_back(entry.path().filename().string() + "=" + word + entry.path().filename().string());
    }
  }
  return words;
}

TEST_F(NothingInCommon, IsNoScore) {
  const bool nets = RunCli({"avatar", "train", "--help"}).exit == 0;
  const std::regex figure("(^|[^a-zA-Z_/.])-?nan([^a-zA-Z_/]|$)|verdict: pass");
  for (size_t i = 0; i < std::size(kRows); ++i) {
    const Row& row = kRows[i];
    if (!nets && row.command.find("avatar") != std::string::npos) continue;  // a build without libtorch
    SCOPED_TRACE(row.command + " " + row.words);
    const CliRun run = In(Words(row, i, *sandbox_));
    EXPECT_EQ(run.exit, row.exit) << run.out << run.err;
    EXPECT_TRUE(Mentions(run.out + run.err, row.part)) << "lacks '" << row.part << "'\n" << run.out << run.err;
    EXPECT_FALSE(std::regex_search(run.out + run.err, figure)) << run.out << run.err;
  }
}

TEST_F(NothingInCommon, HasARowForEveryCommand) {
  std::set<std::string> rows;
  const std::set<std::string> there = Commands();
  for (const Row& row : kRows) rows.insert(row.command);
  for (const char* name : kElsewhere) rows.insert(name);
  EXPECT_GT(there.size(), 30u);
  for (const std::string& name : there) EXPECT_EQ(rows.count(name), 1u) << name << ": what does it say of nothing?";
}

}  // namespace
}  // namespace mvstudio::testing
