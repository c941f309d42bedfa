#include "tests/exports/fixture.h"
#include "tests/support/test.h"

/// The exports opened by the programs that they are for: by the readers' own code, from checkouts in the folder
/// MVSTUDIO_READERS, and by Blender.
namespace mvstudio::exports::testing {
namespace {

std::string Client(const std::string& name) {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return mvstudio::testing::ShellQuote(std::string(source ? source : ".") + "/tests/clients/" + name);
}

/// The JSON objects that a command prints, one a line.
std::vector<nlohmann::json> ObjectsOf(const std::string& command, const TempDir& folder) {
  std::system((command + " >" + (folder / "printed") + " 2>" + (folder / "errors")).c_str());
  std::vector<nlohmann::json> objects;
  std::istringstream lines(mvstudio::testing::Slurp(folder / "printed"));
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line[0] == '{') objects.push_back(nlohmann::json::parse(line));
  }
  return objects;
}

TEST(ForeignReaders, OpenTheExports) {
  const char* readers = std::getenv("MVSTUDIO_READERS");
  if (!readers) GTEST_SKIP() << "needs checkouts of the readers in the folder MVSTUDIO_READERS";
  if (std::system("/usr/bin/python3 -c 'import numpy, cv2, h5py, torch, PIL' >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "needs Debian's python3-numpy, -opencv, -h5py, -torch and -pil";
  for (const bool distorted : {false, true}) {
    SCOPED_TRACE(distorted);
    const TempDir folder;
    Setting setting;
    setting.distorted = distorted;
    const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
    ExportOptions options;
    options.hull_points = 200, options.undistort_view = dataset::UndistortView::kAll;
    for (const char* format : {"zju", "easymocap", "actorshq", "dynamic3dgs", "dna"})
      ExportDataset(dataset, format, folder / ("x/" + std::string(format)), options);
    MakeFolder(folder / "tmp");
    const auto results = ObjectsOf("TMPDIR=" + (folder / "tmp") + " /usr/bin/python3 -B " + Client("foreign_readers.py") + " " +
                                       mvstudio::testing::ShellQuote(readers) + " " + (folder / "x") + " " + (folder / "d"),
                                   folder);
    ASSERT_EQ(results.size(), 6u) << mvstudio::testing::Slurp(folder / "errors");
    for (const nlohmann::json& result : results) {
      if (result.contains("skipped")) {
        std::printf("skipped: %s\n", result.dump().c_str());
        continue;
      }
      EXPECT_TRUE(result["faults"].empty()) << result;
      EXPECT_GT(result["opened"].get<int>(), 0) << result;
    }
  }
}

TEST(ForeignReaders, BlenderSeesWhatTheCamerasSee) {
  if (std::system("blender --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs blender";
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportDataset(dataset, "blender", folder / "out", {});
  const auto results =
      ObjectsOf("blender --background --python " + Client("blender_cameras.py") + " -- " + (folder / "out"), folder);
  ASSERT_EQ(results.size(), 1u) << mvstudio::testing::Slurp(folder / "errors");
  EXPECT_LT(results[0]["max_px"].get<double>(), 0.01) << results[0];
  EXPECT_EQ(results[0]["pictures"], 5) << results[0];
}

}  // namespace
}  // namespace mvstudio::exports::testing
