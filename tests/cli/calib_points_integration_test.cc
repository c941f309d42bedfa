#include <filesystem>

#include "calib/keypoints/bundle.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_io.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// `calib refine --points2d`: markers, wands and animals, as a user runs it.
namespace mvstudio::testing {
namespace {

using calib::testing::FilmPeople;
using calib::testing::PeopleOptions;
using calib::testing::PeopleRig;
using Words = std::vector<std::string>;

/// Frame numbers `frame_step` apart; points are called by `name`.
template <class Name>
void WriteTable(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames, int frame_step,
                const Name& name, const std::string& path) {
  dataset::Pose2dSet set;
  const size_t num_points = frames[0].people[0][0].size();
  for (size_t j = 0; j < num_points; ++j) set.skeleton.joints.push_back(name(j));
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    dataset::Pose2dTrack track{rig.cameras[c].camera.name, {}};
    for (const triangulate::DetectedFrame& frame : frames) {
      std::vector<dataset::Person2d>& people = track.frames[frame.frame * frame_step];
      for (const triangulate::DetectedPerson& person : frame.people[c]) {
        people.emplace_back();
        for (const triangulate::Keypoint& key : person) people.back().keypoints.push_back({key.px.x(), key.px.y(), key.score});
      }
    }
    set.tracks.push_back(std::move(track));
  }
  dataset::WritePose2dCsv(set, path);
}

struct Studio {
  explicit Studio(int num_cameras = 4) : truth(PeopleRig(num_cameras)), start(calib::testing::Disturbed(truth, 0.02, 0.05, 8)) {
    geometry::WriteRig(start, folder / "calib.json");
  }
  CliRun Refine(const Words& more = {}) const {
    Words words = {"calib",
                   "refine",
                   "--calib",
                   folder / "calib.json",
                   "--points2d",
                   folder / "points.csv",
                   "--out",
                   folder / "run",
                   "--no-keypoint-lenses",
                   "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
  /// Largest distance of a camera from its true place, in the frame and scale of the start, metres.
  double Error() const {
    const geometry::Rig found = geometry::ReadRig(folder / "run/calibration.json");
    return geometry::CompareRigs(found, calib::AlignToGiven(truth, start)).max_translation_m;
  }

  TempDir folder;
  geometry::Rig truth, start;
};

PeopleOptions Points(int num_points, int num_frames) {
  PeopleOptions options;
  options.num_joints = num_points, options.num_frames = num_frames;
  options.noise_px = 0.5, options.outlier_fraction = 0.01;
  return options;
}

/// Named markers at time steps that are not connected in time; no skeleton, no limbs.
TEST(CalibPoints, MarkersAtSeparateTimeStepsRefineARig) {
  const Studio studio;
  WriteTable(
      studio.truth, FilmPeople(studio.truth, Points(9, 60)), 1000, [](size_t j) { return "marker_" + std::to_string(j); },
      studio.folder / "points.csv");
  const CliRun run = studio.Refine();
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const auto metrics = run.Json()["metrics"];
  EXPECT_FALSE(metrics["kept_input"].get<bool>());
  EXPECT_GT(metrics["holdout_median_px"]["before"].get<double>(), 5);
  EXPECT_LT(metrics["holdout_median_px"]["after"].get<double>(), 1);
  EXPECT_TRUE(metrics["limb_std_mm"]["after"].is_null());
  ASSERT_EQ(metrics["held_out"].size(), 2u);
  EXPECT_EQ(metrics["held_out"][0]["part"], "second half");
  for (const auto& part : metrics["held_out"]) EXPECT_LT(part["median_px"]["after"].get<double>(), 1);
  EXPECT_EQ(metrics["num_gap_frames"], 2);
  EXPECT_EQ(metrics["num_train_frames"], 60);
  EXPECT_LT(studio.Error(), 0.01);
}

/// A wand of two numbered points.
TEST(CalibPoints, AWandOfTwoNumberedPointsIsEnough) {
  const Studio studio;
  WriteTable(
      studio.truth, FilmPeople(studio.truth, Points(2, 150)), 1, [](size_t j) { return std::to_string(j); },
      studio.folder / "points.csv");
  const CliRun run = studio.Refine({"--from-keypoints"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_LT(studio.Error(), 0.015);
}

/// Two people, one is used by default: the other is told of.
TEST(CalibPoints, PeopleLeftOutAreReported) {
  const Studio studio;
  auto frames = FilmPeople(studio.truth, Points(12, 40));
  PeopleOptions other = Points(12, 40);
  other.seed = 5;
  const auto second = FilmPeople(studio.truth, other, {0.9, -1.1, 0.1});
  for (size_t f = 0; f < 15; ++f)
    for (size_t c = 0; c < 4; ++c) frames[f].people[c].push_back(second[f].people[c][0]);
  WriteTable(
      studio.truth, frames, 1, [](size_t j) { return "p" + std::to_string(j); }, studio.folder / "points.csv");
  CliRun run = studio.Refine();
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const auto left_out = run.Json()["metrics"]["left_out_persons"];
  EXPECT_EQ(left_out["num_persons"], 1);
  EXPECT_EQ(left_out["num_frames"], 15);
  EXPECT_THAT(run.out, HasSubstr("CAL-PERSONS-LEFT-OUT"));
  std::filesystem::remove_all(studio.folder / "run");
  run = studio.Refine({"--max-persons", "2"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["left_out_persons"]["num_frames"], 0);
  EXPECT_GT(run.Json()["metrics"]["num_train_joints"].get<int>(), 40 * 12 * 9 / 10);
}

TEST(CalibPoints, DegenerateTablesEndInOneLine) {
  const Studio studio;
  const auto frames = FilmPeople(studio.truth, Points(9, 30));
  const auto expect_unsolved = [&](const std::vector<triangulate::DetectedFrame>& own) {
    WriteTable(
        studio.truth, own, 1, [](size_t j) { return "m" + std::to_string(j); }, studio.folder / "points.csv");
    const CliRun run = studio.Refine();
    EXPECT_EQ(run.exit, 5) << run.out << run.err;
    EXPECT_EQ(run.Json()["errors"].size(), 1u);
    EXPECT_FALSE(std::filesystem::exists(studio.folder / "run/calibration.json"));
    return run.out;
  };
  auto blind = frames;  // one camera sees nothing
  for (auto& frame : blind)
    for (auto& key : frame.people[3][0]) key.score = 0;
  blind[0].people[3][0][0].score = 1;
  EXPECT_THAT(expect_unsolved(blind), HasSubstr("cam3"));
  auto one_place = frames;
  for (auto& frame : one_place)
    for (size_t c = 0; c < 4; ++c)
      for (auto& key : frame.people[c][0]) key = frames[0].people[c][0][0];
  expect_unsolved(one_place);
}

TEST(CalibPoints, MistakesAreNamed) {
  const Studio studio;
  WriteTable(
      studio.truth, FilmPeople(studio.truth, Points(9, 12)), 1, [](size_t j) { return "m" + std::to_string(j); },
      studio.folder / "points.csv");
  CliRun run = studio.Refine({"--pose2d", "cam0=" + (studio.folder / "x")});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.out, HasSubstr("either --pose2d or --points2d"));
  run = studio.Refine({"--keypoint-gap-frames", "-1"});
  EXPECT_EQ(run.exit, 2);
  // Six time steps in each half at most, of which two cannot be spared.
  run = studio.Refine();
  EXPECT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["num_gap_frames"], 0);
}

}  // namespace
}  // namespace mvstudio::testing
