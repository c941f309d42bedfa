#include <filesystem>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `dataset verify`, `pack` and `export` of a dataset that does not hold every image.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// Three cameras, six frames; camera 00_01 has only frames 0 and 5, camera 00_02 lacks the mask of frame 3.
class SparseDataset : public ::testing::Test {
 protected:
  SparseDataset() {
    avatar::WriteMannequinDataset(data_, 3, 6, 96);
    for (const int frame : {1, 2, 3, 4}) {
      fs::remove(Path("hdImgs", "00_01", frame));
      fs::remove(Path("masks", "00_01", frame));
    }
    fs::remove(Path("masks", "00_02", 3));
  }
  std::string Path(const std::string& kind, const std::string& camera, int frame) const {
    return data_ + "/" + kind + "/" + camera + "/" + camera + "_0000000" + std::to_string(frame) + ".png";
  }

  TempDir folder_;
  std::string data_ = folder_ / "data";
};

TEST_F(SparseDataset, VerifyPassesWithCountsAndFailsForACameraWithoutAny) {
  const CliRun run = RunCli({"dataset", "verify", data_, "--json"});
  EXPECT_EQ(run.exit, 0) << run.out;
  const auto json = run.Json();
  EXPECT_EQ(json["status"], "warn");
  EXPECT_EQ(json["metrics"]["num_errors"], 0);
  EXPECT_EQ(json["metrics"]["missing_pictures"], (nlohmann::json{{"00_01", 4}}));
  EXPECT_EQ(json["metrics"]["missing_masks"], (nlohmann::json{{"00_02", 1}}));
  EXPECT_THAT(run.out, AllOf(HasSubstr("no image for 4 of 6 frames with joints; 4 frames: 1, 2, 3, 4"),
                             HasSubstr("no mask for 1 of 6 frames with joints; 1 frame: 3")));
  fs::remove(Path("hdImgs", "00_01", 0)), fs::remove(Path("hdImgs", "00_01", 5));
  const CliRun without = RunCli({"dataset", "verify", data_, "--json"});
  EXPECT_EQ(without.exit, 6);
  EXPECT_THAT(without.out, HasSubstr("holds no image of this camera"));
}

TEST_F(SparseDataset, PackAndExportTakeWhatThereIs) {
  const CliRun pack = RunCli({"dataset", "pack", data_, "--out", folder_ / "pack", "--crop", "32", "--json"});
  EXPECT_EQ(pack.exit, 6) << pack.err;
  EXPECT_EQ(pack.Json()["metrics"]["samples"], 14);
  EXPECT_EQ(pack.Json()["metrics"]["missing"]["asked"], 18);
  EXPECT_EQ(pack.Json()["metrics"]["missing"]["cameras"]["00_01"]["pictures"], 4);
  ASSERT_EQ(pack.Json()["warnings"].size(), 1u) << "one, not one a picture";
  EXPECT_THAT(pack.Json()["warnings"][0]["text"].get<std::string>(), AllOf(HasSubstr("5 of 18"), HasSubstr("00_01: 4 of 6")));
  EXPECT_EQ(RunCli({"dataset", "pack", data_, "--out", folder_ / "one", "--cameras", "00_01", "--frames", "1-3"}).exit, 3);

  const CliRun exported = RunCli({"dataset", "export", data_, "--to", "easymocap", "--out", folder_ / "out", "--json"});
  EXPECT_EQ(exported.exit, 6) << exported.err;
  EXPECT_EQ(exported.Json()["metrics"]["pictures"], 14);
  EXPECT_EQ(exported.Json()["metrics"]["missing"]["cameras"]["00_01"]["pictures"], 4);
  EXPECT_THAT(exported.out, HasSubstr("4 images are not in the dataset (00_01: 4 of 6)"));
}

}  // namespace
}  // namespace mvstudio::testing
