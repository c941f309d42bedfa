#include <fcntl.h>
#include <sys/stat.h>

#include <fstream>
#include <set>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "tests/support/hostile_files.h"
#include "tests/support/run_cli.h"
#include "tests/support/sanitized.h"
#include "tests/support/test.h"

/// Hostile files and names at the command line: the right exit code, one clear line, nothing written outside the output,
/// bounded memory and time. What a reader does with thousands of damaged files is in hostile_readers_integration_test.cc.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::Eq;

/// Bounds of every command here: address space (libtorch alone maps 2 GB) and time.
const std::string kBounds = MemoryBound(6000) + "ulimit -c 0; timeout -s KILL " + (kSanitized ? "200 " : "20 ");

/// Every path below a folder with its size, links not followed.
std::set<std::string> Listing(const std::string& folder) {
  std::set<std::string> lines;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const bool regular = entry.symlink_status().type() == fs::file_type::regular;
    lines.insert(entry.path().string() + (regular ? " " + std::to_string(entry.file_size()) : ""));
  }
  return lines;
}

/// A few kinds of damage; hostile_readers_integration_test.cc has them all.
std::vector<NamedText> SomeHostileJson(const std::string& good) {
  std::vector<NamedText> some;
  for (const NamedText& text : HostileJson(good)) {
    for (const char* name : {"empty", "half", "deep-inside", "many-digits", "not-utf8"}) {
      if (text.first == name) some.push_back(text);
    }
  }
  return some;
}

/// A tiny session with true calibration and joints, made once.
class Hostile : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempDir;
    const CliRun run = RunCli({"synth", "--out", *shared_ / "studio", "--cameras", "3", "--size", "160x120", "--board-frames",
                               "0", "--take-frames", "3", "--samples", "1"});
    ASSERT_EQ(run.exit, 0) << run.err;
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }
  void SetUp() override {
    fs::create_directory(work_ / "in");
    fs::copy(*shared_ / "studio", studio_, fs::copy_options::recursive);
  }

  /// The command ends with one of `exits` and one printable line that holds `part`, and changes nothing on the disk.
  void ExpectRefused(const std::vector<std::string>& words, const std::string& part, const std::vector<int>& exits = {3}) {
    const std::set<std::string> before = Listing(work_.path());
    const CliRun run = RunCli(words, kBounds);
    const std::string what = ::testing::PrintToString(words).substr(0, 300) + "\n" + run.err.substr(0, 1000);
    EXPECT_THAT(exits, ::testing::Contains(run.exit)) << what;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << what;
    EXPECT_THAT(run.err, HasSubstr(part)) << what;
    EXPECT_LT(run.err.size(), 4200u);
    for (const char c : run.err) EXPECT_TRUE(c == '\n' || (static_cast<unsigned char>(c) >= ' ' && c != '\x7f')) << what;
    EXPECT_EQ(Listing(work_.path()), before) << what;
  }

  std::string Put(const std::string& name, const std::string& content) {
    const std::string path = work_ / "in" + "/" + name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  std::string Calibration() const { return studio_ + "/truth/calibration.json"; }
  std::string Out() const { return work_ / "out"; }

  std::vector<std::string> Triangulate(const std::string& calibration) const {
    std::vector<std::string> words = {"triangulate", "--calib", calibration, "--skeleton", "body25", "--out", Out()};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
      words.insert(words.end(), {"--pose2d", std::string(camera) + "=" + studio_ + "/pose2d/take1/" + camera});
    }
    return words;
  }
  std::vector<std::string> Build(const std::string& calibration, const std::string& pose3d) const {
    std::vector<std::string> words = {"dataset", "build", "--calib", calibration, "--pose3d", pose3d, "--out", Out()};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
      words.insert(words.end(), {"--video", std::string(camera) + "=" + studio_ + "/raw/take1/" + camera + ".mp4"});
    }
    return words;
  }

  TempDir work_;
  const std::string studio_ = work_ / "studio";

 private:
  static TempDir* shared_;
};
TempDir* Hostile::shared_ = nullptr;

TEST_F(Hostile, TheSessionItselfIsGood) {
  EXPECT_EQ(RunCli({"calib", "show", Calibration()}, kBounds).exit, 0);
  const CliRun run = RunCli(Triangulate(Calibration()), kBounds);
  EXPECT_EQ(run.exit, 0) << run.err;
}

TEST_F(Hostile, CalibrationOfEveryKindOfDamage) {
  for (const auto& [name, text] : SomeHostileJson(Slurp(Calibration()))) {
    const std::string path = Put(name + ".json", text);
    ExpectRefused({"calib", "show", path}, path);
  }
}

TEST_F(Hostile, OtherCommandsRefuseTheSameCalibration) {
  const std::string path = Put("deep.json", std::string(100000, '['));
  ExpectRefused(Triangulate(path), path);
  ExpectRefused(Build(path, studio_ + "/truth/pose3d"), path);
  ExpectRefused({"calib", "convert", path, "--to", "toml", "--out", Out()}, path);
}

TEST_F(Hostile, PoseFilesOfEveryKindOfDamage) {
  const std::string folder = studio_ + "/pose2d/take1/cam_02";
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path().string());
  const std::string good = Slurp(files.front());
  for (const auto& [name, text] : SomeHostileJson(good)) {
    for (const std::string& file : files) std::ofstream(file, std::ios::binary) << text;
    ExpectRefused(Triangulate(Calibration()), folder);
  }
}

TEST_F(Hostile, TablesOfJointsAndOffsets) {
  const std::vector<std::string> start = {"triangulate", "--calib", Calibration(), "--out", Out()};
  const auto with = [&](const std::string& flag, const std::string& path) {
    std::vector<std::string> words = start;
    words.insert(words.end(), {flag, path});
    return words;
  };
  const std::string header = "camera,frame,person,joint,x_px,y_px,score\n";
  for (const std::string& text : {std::string(), header + "cam_01,0,0,Nose,1e400,2,1\n", header + "cam_01,0,0,\x1b[31mNose\n",
                                  header + std::string(100000, ',')}) {
    ExpectRefused(with("--points2d", Put("points.csv", text)), work_ / "in/points.csv");
  }
  auto words = Triangulate(Calibration());
  words.insert(words.end(), {"--sync", Put("sync.json", R"({"schema": "mvstudio.sync/1", "reference": 7, "cameras": []})")});
  ExpectRefused(words, work_ / "in/sync.json");
}

TEST_F(Hostile, JointsForADataset) {
  const std::string folder = studio_ + "/truth/pose3d";
  const std::string points = Slurp(folder + "/points.csv"), header = Slurp(folder + "/pose3d.json");
  for (const std::string& text : {std::string(), points.substr(0, points.size() - 20), std::string(100000, 'x')}) {
    std::ofstream(folder + "/points.csv", std::ios::binary) << text;
    ExpectRefused(Build(Calibration(), folder), folder + "/points.csv");
  }
  std::ofstream(folder + "/points.csv", std::ios::binary) << points;
  for (const std::string& text : {std::string("{\"schema\": 7}"), std::string(100000, '[')}) {
    std::ofstream(folder + "/pose3d.json", std::ios::binary) << text;
    ExpectRefused(Build(Calibration(), folder), folder + "/pose3d.json");
  }
}

TEST_F(Hostile, ThingsThatAreNoFiles) {
  const std::string folder = work_ / "in/folder.json", dangling = work_ / "in/dangling.json", loop = work_ / "in/loop.json";
  fs::create_directory(folder);
  fs::create_symlink(work_ / "nowhere", dangling);
  fs::create_symlink(loop, loop);
  for (const std::string& path : {folder, dangling, loop}) ExpectRefused(Triangulate(path), path);
  ExpectRefused({"triangulate", "--calib", Calibration(), "--points2d", loop, "--out", Out()}, loop);
}

TEST_F(Hostile, EndlessAndBlockingInputs) { ExpectRefused({"calib", "show", "/dev/zero"}, "/dev/zero"); }

TEST_F(Hostile, CornersAndOtherCalibrations) {
  for (const std::string& text :
       {std::string(), std::string(1000, '\0'),
        std::string("# camera 640x480 a\n# board 0 chessboard:99999x99999:1mm\ncamera,frame,corner,x_px,y_px\n"),
        std::string("camera,frame,corner,x_px,y_px\na,0,1e9,1,2\n"),
        std::string("<opencv_storage>") + std::string(100000, '<')}) {
    const std::string path = Put("corners.csv", text);
    ExpectRefused({"calibrate", "--corners", path, "--out", Out()}, path, {2, 3});
  }
  std::string keys;
  for (int i = 0; i < 100000; ++i) keys += "a.";
  ExpectRefused({"calib", "show", "--from", "toml", Put("keys.toml", keys + "a = 1\n")}, work_ / "in/keys.toml");
  ExpectRefused({"calib", "show", "--from", "qca", Put("bomb.qca.txt", "<!DOCTYPE a [<!ENTITY b \"c\">]><calibration/>")},
                work_ / "in/bomb.qca.txt");
  ExpectRefused({"calib", "show", "--from", "kalibr", Put("deep.yaml", "cam0: " + std::string(100000, '['))},
                work_ / "in/deep.yaml");
}

TEST_F(Hostile, ImagesThatWouldFillTheMemory) {
  fs::create_directories(work_ / "a");
  fs::create_directories(work_ / "b");
  for (const auto& [name, bytes] : ImageBombs()) {
    for (const char* folder : {"a", "b"}) {
      fs::remove_all(work_ / folder);
      fs::create_directories(work_ / folder);
      std::ofstream(work_ / folder + "/" + name, std::ios::binary) << bytes;
    }
    ExpectRefused({"metrics", work_ / "a", work_ / "b"}, name);
  }
}

TEST_F(Hostile, NamesThatWouldLeaveTheOutput) {
  nlohmann::json calibration = nlohmann::json::parse(Slurp(Calibration()));
  const std::pair<const char*, const char*> tries[] = {
      {"../../evil", "opencv"}, {"/tmp/evil", "opencv"}, {"a/b", "opencv"}, {"..", "easymocap"},
      {"line\nbreak", "mrcal"}, {"../../evil", "zju"},   {"..", "colmap"}};
  for (const auto& [name, format] : tries) {
    calibration["cameras"][1]["name"] = name;
    const std::string path = Put("names.json", calibration.dump());
    const std::set<std::string> before = Listing(work_.path());
    const CliRun run =
        RunCli({"calib", "convert", path, "--to", format, "--allow-approximation", "5", "--out", Out()}, kBounds);
    EXPECT_THAT(run.exit, AnyOf(Eq(0), Eq(2), Eq(3))) << name << " " << format << ": " << run.err;
    for (const std::string& line : Listing(work_.path())) {
      EXPECT_TRUE(before.count(line) || line.rfind(Out(), 0) == 0) << name << " " << format << " wrote " << line;
    }
    fs::remove_all(Out());
  }
  EXPECT_FALSE(fs::exists("/tmp/evil.yml") || fs::exists("/tmp/evil.cameramodel"));
}

TEST_F(Hostile, SequenceNamesThatWouldLeaveTheDataset) {
  for (const std::string name : {"../../evil", "a/b", "", "x\ny", "\xff\xfe"}) {
    auto words = Build(Calibration(), studio_ + "/truth/pose3d");
    words.insert(words.end(), {"--sequence", name});
    ExpectRefused(words, "sequence", {2, 3});
  }
}

TEST_F(Hostile, SessionsThatPointElsewhere) {
  const std::string session = work_ / "in/session", secret = work_ / "in/secret.mp4";
  fs::create_directories(session + "/raw/take1");
  fs::copy_file(studio_ + "/raw/take1/cam_01.mp4", secret);
  fs::create_symlink(secret, session + "/raw/take1/link.mp4");
  fs::create_directory_symlink(work_ / "in", session + "/raw/out");
  const auto build = [&](const std::string& footage) {
    std::ofstream(session + "/mvstudio.toml") << "schema = \"mvstudio.session/1\"\nunits = \"m\"\ncameras = [\"cam_01\"]\n"
                                              << "[[takes]]\nname = \"take1\"\nfootage = {cam_01 = \"" << footage << "\"}\n";
    return std::vector<std::string>{"dataset", "build", "--calib",   Calibration(), "--pose3d", studio_ + "/truth/pose3d",
                                    "--out",   Out(),   "--session", session};
  };
  for (const std::string footage : {"../secret.mp4", "raw/take1/link.mp4", "raw/out/secret.mp4", "raw/../../secret.mp4"}) {
    ExpectRefused(build(footage), footage);
  }
  ExpectRefused(build(secret), secret);
}

TEST_F(Hostile, SessionFilesOfEveryKindOfDamage) {
  const std::string session = work_ / "in/session", path = session + "/mvstudio.toml";
  fs::create_directory(session);
  const std::string head = "schema = \"mvstudio.session/1\"\nunits = \"m\"\n";
  for (const std::string& text : {std::string(), head + "cameras = [\"../../x\"]\n", head + "cameras = [\"\\u001b[2J\"]\n",
                                  head + "cameras = " + std::string(100000, '['), head + Repeated("a.", 100000) + "a = 1\n",
                                  head + "fps_hz = nan\n", "\xff\xfe" + head}) {
    std::ofstream(path, std::ios::binary) << text;
    ExpectRefused({"session", "show", session}, "mvstudio.toml");
  }
}

TEST_F(Hostile, CameraNamesOfFootageThatWouldLeaveTheOutput) {
  const std::string video = studio_ + "/raw/take1/cam_01.mp4";
  for (const std::string name : {"../../evil", "/evil", "..", "a\nb", "\xff"}) {
    const std::set<std::string> before = Listing(work_.path());
    const CliRun run = RunCli({"mask", "--backend", "background", "--video", name + "=" + video, "--out", Out()}, kBounds);
    EXPECT_NE(run.exit, 1) << name << ": " << run.err;
    for (const std::string& line : Listing(work_.path())) {
      EXPECT_TRUE(before.count(line) || line.rfind(Out(), 0) == 0) << name << " wrote " << line;
    }
    EXPECT_FALSE(fs::exists(work_ / "../evil")) << name;  // two levels above the output
    fs::remove_all(Out());
  }
}

TEST_F(Hostile, DatasetsOfEveryKindOfDamage) {
  const CliRun built = RunCli(Build(Calibration(), studio_ + "/truth/pose3d"), kBounds);
  ASSERT_EQ(built.exit, 0) << built.err;
  const std::string scene = Out() + "/hdPose3d_stage1_coco19/body3DScene_00000001.json";
  const std::string good = Slurp(scene);
  for (const auto& [name, text] : SomeHostileJson(good)) {
    std::ofstream(scene, std::ios::binary) << text;
    const std::set<std::string> before = Listing(work_.path());
    const CliRun run = RunCli({"dataset", "verify", Out(), "--json"}, kBounds);
    EXPECT_EQ(run.exit, 6) << name << ": " << run.err;  // one frame of three is bad
    EXPECT_THAT(run.out, HasSubstr("body3DScene_00000001.json")) << name;
    EXPECT_EQ(Listing(work_.path()), before) << name;
  }
  std::ofstream(scene, std::ios::binary) << good;
  const std::string image = Out() + "/hdImgs/00_01/00_01_00000001.jpg";
  ASSERT_TRUE(fs::exists(image));
  for (const auto& [name, bytes] : ImageBombs()) {
    std::ofstream(image, std::ios::binary) << bytes;
    const CliRun run = RunCli({"dataset", "verify", Out(), "--json"}, kBounds);
    EXPECT_EQ(run.exit, 6) << name << ": " << run.err;
    EXPECT_THAT(run.out, HasSubstr("00_01_00000001.jpg")) << name;
  }
  std::ofstream(FilesMatching(Out() + "/calibration_*.json").at(0), std::ios::binary) << std::string(100000, '[');
  EXPECT_EQ(RunCli({"dataset", "verify", Out()}, kBounds).exit, 3);
}

TEST_F(Hostile, EmojiAndSpacesAreOrdinaryNames) {
  nlohmann::json calibration = nlohmann::json::parse(Slurp(Calibration()));
  const std::string name = "Kamera \xf0\x9f\x8e\xa5 links";
  calibration["cameras"][1]["name"] = name;
  const CliRun run = RunCli({"calib", "show", "--json", Put("emoji.json", calibration.dump())}, kBounds);
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_TRUE(run.Json().is_object());
  EXPECT_THAT(run.out, HasSubstr(name));
}

TEST_F(Hostile, ArgumentsThatAreNoText) {
  const std::string word = "a\xff\n\x1b[2J=";
  ExpectRefused({"triangulate", "--calib", Calibration(), "--pose2d", word + "x", "--out", Out()}, "", {2, 3});
  ExpectRefused({"calib", "show", work_ / "in/no\nsuch\xff.json"}, "no such", {2, 3});
  ExpectRefused({"\xff\xfe"}, "", {2});
  const CliRun run = RunCli({"calib", "show", "--json", work_ / "in/\xff.json"}, kBounds);
  EXPECT_TRUE(run.Json().is_object()) << run.out;
}

}  // namespace
}  // namespace mvstudio::testing
