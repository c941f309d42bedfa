#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::testing {
namespace {

using Json = nlohmann::json;

/// One frame of OpenPose JSON with or without a person of 25 joints, all at one place.
void WriteFrame(const std::string& folder, int frame, bool person, const std::string& x = "100") {
  std::filesystem::create_directories(folder);
  std::string points;
  for (int j = 0; j < 25; ++j) points += (j ? "," : "") + x + ",100,0.9";
  std::ofstream out(folder + "/" + std::to_string(frame) + "_keypoints.json");
  out << R"({"version":1.3,"people":[)" << (person ? R"({"pose_keypoints_2d":[)" + points + "]}" : "") << "]}";
}

/// `words` with the options of `more` in place of their own.
std::vector<std::string> With(std::vector<std::string> words, const std::vector<std::string>& more) {
  for (size_t i = 0; i + 1 < more.size(); i += 2) {
    const auto found = std::find(words.begin(), words.end(), more[i]);
    if (found != words.end()) {
      *(found + 1) = more[i + 1];
    } else {
      words.insert(words.end(), {more[i], more[i + 1]});
    }
  }
  return words;
}

class AvatarLift : public ::testing::Test {
 protected:
  void SetUp() override {
    MVS_NEEDS_DATA("person_a");
    data_ = DataRoot() + "/person_a";
  }
  CliRun Train(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"avatar",           "lift",  "train",   data_, "--out",     folder_ / "l.safetensors",
                                      "--width",          "128",   "--steps", "250", "--batch",   "64",
                                      "--baseline-poses", "1024",  "--seed",  "1",   "--threads", "1",
                                      "--overwrite",      "--json"};
    return RunCli(With(words, more));
  }
  CliRun Apply(const std::string& poses, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"avatar",      "lift",
                                      "apply",       poses,
                                      "--lifter",    folder_ / "l.safetensors",
                                      "--calib",     data_ + "/calibration_person_a.json",
                                      "--camera",    "00_00",
                                      "--out",       folder_ / "pose3d",
                                      "--overwrite", "--json"};
    return RunCli(With(words, more));
  }
  TempDir folder_;
  std::string data_;
};

TEST_F(AvatarLift, BeatsBothBaselinesOnHeldOutFramesAndLiftsDetections) {
  const Json trained = Train().Json();
  ASSERT_TRUE(trained.is_object());
  EXPECT_EQ(trained["exit"], 0);
  const Json& held = trained["metrics"]["holdout"];
  EXPECT_EQ(held["lifter"]["frames"], 300);
  for (const char* baseline : {"mean_pose", "nearest_neighbour"}) {
    EXPECT_LT(held["lifter"]["mpjpe_mm"].get<double>(), held[baseline]["mpjpe_mm"].get<double>()) << baseline;
    EXPECT_LT(held["lifter"]["procrustes_mpjpe_mm"].get<double>(), held[baseline]["procrustes_mpjpe_mm"].get<double>());
  }
  const Json lifted = Apply(data_ + "/pose2d/00_00", {"--truth", data_}).Json();
  EXPECT_EQ(lifted["exit"], 0);
  EXPECT_EQ(lifted["metrics"]["lifted"], 120);
  EXPECT_LT(lifted["metrics"]["truth"]["mpjpe_mm"].get<double>(), 200);
  EXPECT_LT(lifted["metrics"]["truth"]["root_mm"].get<double>(), 400);
  // Size is what one camera cannot see: a person said to be half as tall stands half as far.
  const Json small = Apply(data_ + "/pose2d/00_00", {"--height-m", "0.85"}).Json();
  EXPECT_NEAR(small["metrics"]["size_m"].get<double>(), 0.779 * 0.85, 1e-12);
  EXPECT_NEAR(small["metrics"]["median_rms_px"].get<double>(), lifted["metrics"]["median_rms_px"].get<double>(), 1e-6);
}

TEST_F(AvatarLift, SaysWhyFramesWereNotLifted) {
  Train({"--steps", "80", "--holdout-share", "0"});  // enough to be in front of the camera
  const std::string poses = folder_ / "poses";
  for (int f = 0; f < 3; ++f) WriteFrame(poses, f, false);
  const Json nobody = Apply(poses).Json();
  EXPECT_EQ(nobody["exit"], 5);
  EXPECT_EQ(nobody["metrics"]["status_counts"]["TooFewViews"], 3);
  WriteFrame(poses, 3, true);
  const Json point = Apply(poses).Json();
  EXPECT_EQ(point["exit"], 5);
  EXPECT_EQ(point["metrics"]["status_counts"]["Degenerate"], 1);
  std::filesystem::copy(data_ + "/pose2d/00_00", folder_ / "one", std::filesystem::copy_options::recursive);
  WriteFrame(folder_ / "one", 500, false);
  const Json partial = Apply(folder_ / "one").Json();
  EXPECT_EQ(partial["exit"], 6);
  EXPECT_THAT(partial["warnings"].dump(), HasSubstr("frame 500: TooFewViews"));
  std::filesystem::create_directories(folder_ / "single");
  std::filesystem::copy(data_ + "/pose2d/00_00/00000007_keypoints.json", folder_ / "single");
  EXPECT_EQ(Apply(folder_ / "single").Json()["metrics"]["lifted"], 1);
}

TEST_F(AvatarLift, MistakesAreNamed) {
  Train({"--steps", "1", "--holdout-share", "0"});
  const CliRun camera = Apply(data_ + "/pose2d/00_00", {"--camera", "nobody"});
  EXPECT_EQ(camera.exit, 2);
  EXPECT_THAT(camera.out, HasSubstr("it has 00_00, 00_01"));
  EXPECT_EQ(Apply(data_ + "/pose2d/00_00", {"--stride", "0"}).exit, 2);
  EXPECT_EQ(Apply(data_ + "/pose2d/00_00", {"--lifter", data_ + "/README.md"}).exit, 3);
  EXPECT_EQ(Apply(folder_ / "nothing").exit, 3);
  EXPECT_EQ(Train({"--noise", "-1"}).exit, 2);
  EXPECT_EQ(Train({"--learning-rate", "5"}).exit, 2);
}

}  // namespace
}  // namespace mvstudio::testing
