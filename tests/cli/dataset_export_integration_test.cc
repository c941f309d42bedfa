#include "core/disk/paths.h"
#include "geometry/rig/rig_io.h"
#include "tests/exports/fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// dataset export and calib convert to the formats of datasets, as a user runs them.
namespace mvstudio::testing {
namespace {

using exports::testing::MakeDataset;
using exports::testing::MakeRig;
using exports::testing::Setting;
namespace fs = std::filesystem;

TEST(DatasetExport, WritesTheFolderAndKeepsTheResultBesideIt) {
  const TempDir folder;
  MakeDataset(folder / "d", {});
  const CliRun run = RunCli({"dataset", "export", folder / "d", "--to", "zju", "--out", folder / "out", "--cameras",
                             "00_00,00_02", "--frames", "245-246", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto json = run.Json();
  EXPECT_EQ(json["metrics"]["num_cameras"], 2);
  EXPECT_EQ(json["metrics"]["num_frames"], 2);
  EXPECT_EQ(json["metrics"]["pictures"], 4);
  EXPECT_TRUE(fs::exists(folder / "out/annots.npy"));
  EXPECT_TRUE(fs::exists(folder / "out/export.json"));
  EXPECT_TRUE(fs::exists(folder / "out/provenance.jsonl"));
  EXPECT_FALSE(FilesMatching(folder / "out/*.result.json").empty());
}

TEST(DatasetExport, CamerasAndJointsNeedNoImages) {
  const TempDir folder;
  MakeDataset(folder / "d", {});
  fs::remove_all(folder / "d/hdImgs");
  fs::remove_all(folder / "d/masks");
  const auto run = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"dataset", "export", folder / "d", "--overwrite", "--out", folder / "out"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  };
  EXPECT_EQ(run({"--to", "gltf"}).exit, 0);
  EXPECT_EQ(run({"--to", "zju", "--pictures", "none"}).exit, 0);
  EXPECT_TRUE(fs::exists(folder / "out/annots.npy"));
  EXPECT_EQ(run({"--to", "zju"}).exit, 3);
}

TEST(DatasetExport, SaysWhatIsWrongWithTheRightExitCode) {
  const TempDir folder;
  const auto dataset = MakeDataset(folder / "d", {});
  const std::string d = folder / "d", out = folder / "out";
  const auto exit_of = [&](std::vector<std::string> words, const std::string& text) {
    std::vector<std::string> line = {"dataset", "export"};
    line.insert(line.end(), words.begin(), words.end());
    const CliRun run = RunCli(line);
    EXPECT_THAT(run.out + run.err, HasSubstr(text));
    return run.exit;
  };
  EXPECT_EQ(exit_of({d, "--to", "obj", "--out", out}, "unknown format 'obj'"), 2);
  EXPECT_EQ(exit_of({d, "--to", "zju", "--out", out, "--frames", "1-3"}, "has no frames 1 to 3; it has "), 4);
  EXPECT_EQ(exit_of({folder / "nothing", "--to", "zju", "--out", out}, "no such folder"), 3);
  fs::remove(dataset.ImagePath("00_03", 246));
  EXPECT_EQ(exit_of({d, "--to", "zju", "--out", out}, "1 images are not in the dataset"), 6);
  EXPECT_EQ(exit_of({d, "--to", "zju", "--out", out}, "up to date"), 6) << "it still lacks an image";
  EXPECT_EQ(exit_of({d, "--to", "npz", "--out", out}, "exists already"), 2);
  EXPECT_EQ(exit_of({d, "--to", "trc", "--out", out, "--overwrite"}, "1 people"), 0);
  EXPECT_FALSE(fs::exists(out + "/annots.npy"));
}

TEST(DatasetExport, AFullDiskLeavesThePreviousExport) {
  if (std::system("unshare -rm true >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "needs the right to mount a small disk (unshare -rm)";
  const TempDir folder;
  Setting setting;
  setting.width = 640, setting.height = 480;
  MakeDataset(folder / "d", setting);
  const std::string disk = folder / "disk";
  fs::create_directory(disk);
  const std::string line =
      " dataset export " + ShellQuote(folder / "d") + " --out " + ShellQuote(disk + "/out") + " --overwrite ";
  const std::string script = "mount -t tmpfs -o size=100k none " + disk + " && " + ShellQuote(CliPath()) + line +
                             "--to csv && " + ShellQuote(CliPath()) + line + "--to zju --pictures copy >" + (folder / "log") +
                             " 2>&1; code=$?; test -f " + disk + "/out/joints.csv && exit $code";
  const int status = std::system(("unshare -rm sh -c " + ShellQuote(script) + " >/dev/null 2>&1").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 7) << Slurp(folder / "log");
  EXPECT_THAT(Slurp(folder / "log"), HasSubstr("free some space"));
}

TEST(CalibConvert, KnowsTheFormatsOfDatasets) {
  const TempDir folder;
  geometry::Rig rig = MakeRig({});
  rig.cameras[0].camera.name = "left eye";
  geometry::WriteRig(rig, folder / "rig.json");
  for (const std::string format : {"zju", "gltf"}) {
    const CliRun run = RunCli({"calib", "convert", folder / "rig.json", "--to", format, "--out", folder / format, "--json"});
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    EXPECT_EQ(run.Json()["metrics"]["format"], format);
    EXPECT_EQ(run.Json()["metrics"]["renamed"]["left eye"], "left_eye");
    ASSERT_FALSE(run.Json()["outputs"].empty());
    EXPECT_TRUE(fs::exists(run.Json()["outputs"][0]["path"].get<std::string>()));
  }
}

/// The client projects the dataset's joints through what `calib convert` wrote.
TEST(CalibConvert, CamerasOfEveryFormatShowTheJointsWhereTheyAre) {
  if (exports::testing::Python().empty()) GTEST_SKIP() << "needs a python3 with numpy and h5py";
  const TempDir folder;
  for (const bool distorted : {false, true}) {
    Setting setting;
    setting.distorted = distorted;
    setting.images = setting.masks = false;
    setting.frames = {245};
    const std::string root = folder / (distorted ? "lens" : "pinhole");
    MakeDataset(root, setting);
    std::vector<std::string> formats = {"colmap", "easymocap", "zju", "dna", "npz", "gltf", "ply"};
    if (!distorted) formats.insert(formats.end(), {"nerfstudio", "actorshq", "humman"});  // these have no k3
    std::vector<exports::testing::Reading> readings;
    for (const std::string& format : formats) {
      const std::string out = root + "-" + format;
      const CliRun run = RunCli({"calib", "convert", root + "/calibration_test.json", "--to", format, "--out", out});
      ASSERT_EQ(run.exit, 0) << run.err;
      readings.push_back({format, out, root});
    }
    std::string log;
    const auto results = exports::testing::ReadByClient(readings, &log);
    ASSERT_EQ(results.size(), formats.size()) << log;
    for (const auto& result : results) {
      EXPECT_TRUE(result["faults"].empty()) << result;
      EXPECT_GT(result["pixels"].get<int>(), 0) << result;
      EXPECT_LT(result["max_px"].get<double>(), 1e-6) << result;
    }
  }
}

}  // namespace
}  // namespace mvstudio::testing
