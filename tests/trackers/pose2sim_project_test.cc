#include <filesystem>

#include "core/error.h"
#include "dataset/trackers/project_world.h"
#include "dataset/trackers/tracked_project.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;

/// Two trials below one Config.toml, which the second trial's own overrides in part.
class Pose2Sim : public ::testing::Test {
 protected:
  Pose2Sim() {
    Put(folder_ / "Config.toml",
        "[project]\nframe_rate = 60\nframe_range = []\n[pose]\npose_model = 'BODY_25B'\n[triangulation]\n"
        "likelihood_threshold_triangulation = 0.4\nmin_cameras_for_triangulation = 3\ninterpolation = 'cubic'\n"
        "interp_if_gap_smaller_than = 10\nreproj_error_threshold_triangulation = 15\n[filtering]\ntype = 'butterworth'\n"
        "[filtering.butterworth]\norder = 4\ncut_off_frequency = 6\n");
    Put(folder_ / "calibration/Calib_lab.toml",
        "[cam_01]\nname = 'cam_01'\nmatrix = [[1.0]]\n[cam_02]\nname = 'cam_02'\nmatrix = [[1.0]]\n"
        "[metadata]\nadjusted = false\n");
    for (const char* trial : {"walk", "jump"}) {
      for (const char* camera : {"cam01", "cam02"}) Put(folder_ / trial + "/pose/" + camera + "_json/f_0000.json", "{}");
    }
    Put(folder_ / "jump/Config.toml",
        "[project]\nframe_range = [10, 300]\n[filtering]\ntype = 'gaussian'\n[filtering.gaussian]\nsigma_kernel = 2\n");
  }
  TempDir folder_;
};

TEST_F(Pose2Sim, IsReadWhole) {
  const TrackedProject project = ReadTrackedProject(folder_.path());
  EXPECT_EQ(project.program, "Pose2Sim");
  ASSERT_EQ(project.takes.size(), 2u);
  const TrackedProject::Take& walk = FindTake(project, "walk");
  ASSERT_EQ(walk.files.size(), 2u);
  EXPECT_EQ(walk.files[1].camera, "cam_02") << "cam02 of the folders is cam_02 of the calibration";
  EXPECT_THAT(walk.files[1].path, HasSubstr("walk/pose/cam02_json"));
  EXPECT_THAT(walk.calibration, HasSubstr("Calib_lab.toml"));
  const ProjectSettings& settings = project.settings;
  EXPECT_EQ(settings.skeleton, "body25b");
  EXPECT_EQ(settings.frame_rate_hz, 60);
  EXPECT_EQ(settings.min_score, 0.4);
  EXPECT_EQ(settings.min_views, 3);
  EXPECT_EQ(settings.fill_frames, 10);
  EXPECT_EQ(settings.filter, "butterworth:6Hz");
  EXPECT_EQ(settings.frames, "");
  EXPECT_THAT(project.unused, Contains("triangulation.reproj_error_threshold_triangulation"));
}

TEST_F(Pose2Sim, ATrialsOwnSettingsComeFirst) {
  const TrackedProject project = ReadTrackedProject(folder_ / "jump");
  ASSERT_EQ(project.takes.size(), 1u);
  EXPECT_EQ(project.takes[0].name, "jump");
  EXPECT_EQ(project.settings.frames, "10-299");
  EXPECT_EQ(project.settings.filter, "gaussian-frames:2");
  EXPECT_EQ(project.settings.frame_rate_hz, 60) << "of the folder above";
  Put(folder_ / "walk/pose-associated/left_json/f_0000.json", "{}"),
      Put(folder_ / "walk/pose-associated/right_json/f_0000.json", "{}");
  const TrackedProject by_order = ReadTrackedProject(folder_ / "walk");
  EXPECT_EQ(by_order.takes.at(0).files.at(0).camera, "cam_01");
  EXPECT_THAT(by_order.takes[0].files[0].path, HasSubstr("pose-associated/left_json"));
  EXPECT_THAT(by_order.notes, Contains(HasSubstr("by their order")));
}

TEST_F(Pose2Sim, SaysWhatIsMissing) {
  Put(folder_ / "calibration/other.toml", "");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackedProject(folder_.path()); }), HasSubstr("several .toml"));
  fs::remove_all(folder_ / "calibration");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackedProject(folder_.path()); }), HasSubstr("no folder calib"));
  fs::remove_all(folder_ / "walk"), fs::remove_all(folder_ / "jump");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackedProject(folder_.path()); }), HasSubstr("no trial"));
}

std::vector<JointRow> Points(const std::vector<std::pair<std::string, Eigen::Vector3d>>& points) {
  std::vector<JointRow> rows;
  for (int frame = 0; frame < 3; ++frame) {
    for (const auto& [name, x] : points) {
      JointRow row;
      row.frame = frame, row.joint = name, row.status = Status::kOk, row.x_in_world = x;
      row.covariance = Eigen::Vector3d(1, 4, 9).asDiagonal();
      rows.push_back(row);
    }
  }
  return rows;
}

TEST(ProjectWorld, HasTheAxesAndTheOriginThatWereAskedFor) {
  std::vector<JointRow> rows = Points({{"tail", {5, 1, 0}}, {"nose", {5, 3, 0}}, {"paw", {5, 1, -1}}, {"ear", {5, 1.4, 2}}});
  ProjectSettings settings;
  settings.axes = {{'x', "tail", "nose"}, {'z', "paw", "ear"}}, settings.reference_point = "tail";
  const ProjectWorld world = WorldOfProject(settings, rows, "config.toml");
  MoveTo(world, &rows);
  EXPECT_LT((rows[0].x_in_world - Eigen::Vector3d(0, 0, 0)).norm(), 1e-12);
  EXPECT_LT((rows[1].x_in_world - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12) << "x runs from tail to nose";
  EXPECT_LT((rows[3].x_in_world - Eigen::Vector3d(0.4, 0, 2)).norm(), 1e-12) << "z is right-angled to it";
  // y = z cross x: old z cross old y is minus old x.
  EXPECT_LT((*rows[0].covariance - Eigen::Matrix3d(Eigen::Vector3d(4, 1, 9).asDiagonal())).norm(), 1e-12);
  EXPECT_THAT(world.text, HasSubstr("x from tail to nose"));
  settings.axes[1] = {'y', "nose", "tail"};
  EXPECT_THAT(MessageOf<FormatError>([&] { WorldOfProject(settings, rows, "c"); }), HasSubstr("same direction"));
  settings.axes[1].to = "wing";
  EXPECT_THAT(MessageOf<FormatError>([&] { WorldOfProject(settings, rows, "c"); }), HasSubstr("`wing`"));
  settings.angles = {{"bend", {"nose", "tail", "ear"}}};
  EXPECT_THAT(ProjectAnglesCsv(settings, rows), HasSubstr("\n2,0,bend,78.69"));
}

}  // namespace
}  // namespace mvstudio::dataset
