#include "stages/input/tracker_input.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "stages/input/project_input.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Projects of anipose and caliscope as whole folders, and cameras whose files differ.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

std::string Seed(const std::string& name) {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::string(source ? source : ".") + "/tests/fuzz/seeds/" + name;
}

std::string CalibrationToml(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    text += "[cam_" + std::to_string(i) + "]\nname = \"" + names[i] +
            "\"\nsize = [640, 480]\nmatrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]\n"
            "distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\nrotation = [0.0, " +
            std::to_string(0.5 * static_cast<double>(i)) + ", 0.0]\ntranslation = [0.0, 0.0, 400.0]\nfisheye = false\n\n";
  }
  return text;
}

/// A project with two sessions; the second has two videos.
class Anipose : public ::testing::Test {
 protected:
  Anipose() {
    Put(folder_ / "config.toml", Config(""));
    for (const std::string session : {"day1", "day2"}) {
      Put(folder_ / session + "/calibration/calibration.toml", CalibrationToml({"A", "B"}));
      for (const std::string camera : {"A", "B"}) {
        CopyPose(session + "/pose-2d/walk-cam" + camera + ".h5");
        if (session == "day2") CopyPose(session + "/pose-2d/run-cam" + camera + ".h5");
      }
    }
  }
  static std::string Config(const std::string& more) {
    return "project = 'mice'\nnesting = 1\n[calibration]\nboard_square_side_length = 25\n[triangulation]\n"
           "cam_regex = '-cam([A-Z])$'\n" +
           more;
  }
  void CopyPose(const std::string& name) const {
    const fs::path path = folder_ / name;
    fs::create_directories(path.parent_path());
    fs::copy_file(Seed("tracker_hdf5/dlc_one_table.h5"), path);
  }
  PoseArguments Fill(const std::string& take, InputNotes* result) const {
    PoseArguments pose;
    FillFromProject(folder_.path(), {"", take, false}, &pose, result);
    return pose;
  }
  std::string Message(const std::string& take = "day1/walk") const {
    InputNotes result;
    try {
      Fill(take, &result);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "no exception";
  }
  TempDir folder_;
};

TEST_F(Anipose, TakesGoBySessionAndVideo) {
  InputNotes result;
  const PoseArguments pose = Fill("day2/run", &result);
  EXPECT_EQ(pose.calib, folder_ / "day2/calibration/calibration.toml");
  ASSERT_EQ(pose.pose2d.size(), 2u);
  EXPECT_EQ(pose.pose2d[1].name, "B");
  EXPECT_EQ(pose.pose2d[1].path, folder_ / "day2/pose-2d/run-camB.h5");
  EXPECT_EQ(pose.calib_unit, "mm");
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].text, HasSubstr("taken as mm: its board's squares are 25"));
  EXPECT_THAT(Message(""), AllOf(HasSubstr("several takes"), HasSubstr("day1/walk, day2/run, day2/walk")));
  EXPECT_THAT(Message("day3/walk"), HasSubstr("no take `day3/walk`"));
}

TEST_F(Anipose, SettingsThatMakeTheWorldComeAlong) {
  Put(folder_ / "config.toml",
      Config(
          "axes = [['x', 'tail base', 'nose'], ['z', 'nose', 'Öhrchen']]\nreference_point = 'nose'\nscore_threshold = 0.7\n"
          "ransac = true\n[angles]\nbend = ['hinge', 'nose', 'tail base', 'Öhrchen']\nspin = ['axis', 'nose', 'Öhrchen']\n"));
  InputNotes result;
  PoseArguments pose;
  const dataset::ProjectSettings settings = FillFromProject(folder_.path(), {"", "day1/walk", false}, &pose, &result).settings;
  ASSERT_EQ(settings.axes.size(), 2u);
  EXPECT_EQ(settings.axes[1].axis, 'z');
  EXPECT_EQ(settings.axes[1].to, "Öhrchen");
  EXPECT_EQ(settings.reference_point, "nose");
  EXPECT_EQ(settings.min_score, 0.7);
  ASSERT_EQ(settings.angles.size(), 1u);
  EXPECT_EQ(settings.angles[0].joints[1], "tail base");
  EXPECT_THAT(result.warnings.at(1).text, AllOf(HasSubstr("triangulation.ransac"), HasSubstr("angles.spin (axis)")));
  Put(folder_ / "config.toml", Config("axes = [['x', 'tail base', 'nose'], ['x', 'nose', 'Öhrchen']]\n"));
  EXPECT_THAT(Message(), HasSubstr("triangulation.axes"));
}

TEST_F(Anipose, FilesOfATakeAreReadTogether) {
  InputNotes result;
  const PoseInput input = ReadPoseInput(Fill("day1/walk", &result), &result);
  EXPECT_THAT(input.skeleton.joints, ElementsAre("nose", "tail base", "Öhrchen"));
  EXPECT_THAT(input.cameras, ElementsAre("A", "B"));
  EXPECT_EQ(input.frames.size(), 5u);
  EXPECT_NEAR(input.rig.cameras[0].cam_from_world.translation.z(), 0.4, 1e-12);  // mm
}

TEST_F(Anipose, ItsConstraintsAreBones) {
  const std::string scheme = "[labeling]\nscheme = [['nose', 'tail base', 'Öhrchen'], ['nose', 'whisker']]\n";
  Put(folder_ / "config.toml", Config(scheme));
  InputNotes result;
  const auto bones = [&] { return ReadPoseInput(Fill("day1/walk", &result), &result).skeleton.bones; };
  EXPECT_THAT(bones(), ElementsAre(std::pair{0, 1}, std::pair{1, 2}));
  Put(folder_ / "config.toml", Config("constraints = [['Öhrchen', 'nose'], ['nose', 'Öhrchen'], ['nose', 'nose']]\n" + scheme));
  EXPECT_THAT(bones(), ElementsAre(std::pair{2, 0}));
}

TEST_F(Anipose, FilteredPointsWhereTheConfigurationSaysSo) {
  Put(folder_ / "config.toml", Config("[filter]\nenabled = true\n"));
  InputNotes result;
  EXPECT_EQ(Fill("day1/walk", &result).pose2d[0].path, folder_ / "day1/pose-2d/walk-camA.h5");  // the filter has not run
  CopyPose("day1/pose-2d-filtered/walk-camA.h5"), CopyPose("day1/pose-2d-filtered/walk-camB.h5");
  EXPECT_EQ(Fill("day1/walk", &result).pose2d[0].path, folder_ / "day1/pose-2d-filtered/walk-camA.h5");
  PoseArguments pose;
  EXPECT_TRUE(FillFromProject(folder_.path(), {"", "day1/walk", false}, &pose, &result).filtered);
}

TEST_F(Anipose, OneCalibrationAboveAllSessionsAndFilesWithoutACamera) {
  for (const char* session : {"day1", "day2"}) fs::remove_all(folder_ / session + "/calibration");
  EXPECT_THAT(Message(), HasSubstr("run anipose calibrate"));
  Put(folder_ / "calibration/calibration.toml", CalibrationToml({"A", "B"}));
  CopyPose("day1/pose-2d/overview.h5"), CopyPose("day1/pose-2d/lonely-camA.h5");
  InputNotes result;
  EXPECT_EQ(Fill("day1/walk", &result).calib, folder_ / "calibration/calibration.toml");
  ASSERT_EQ(result.warnings.size(), 3u);
  EXPECT_THAT(result.warnings[1].text, HasSubstr("overview.h5: its name holds no camera"));
  EXPECT_THAT(result.warnings[2].text, HasSubstr("lonely-camA.h5: no other camera"));
}

TEST_F(Anipose, WhatIsWrongInTheConfigurationIsNamed) {
  Put(folder_ / "config.toml", Config("[cameras.A]\noffset = [10, 0]\n"));
  EXPECT_THAT(Message(), HasSubstr("cameras.A.offset: its videos were cropped"));
  Put(folder_ / "config.toml", "[triangulation]\ncam_regex = '-cam([A-'\n");
  EXPECT_THAT(Message(), HasSubstr("is no regular expression"));
  Put(folder_ / "config.toml", "[triangulation]\ncam_regex = '-cam[A-Z]'\n");
  EXPECT_THAT(Message(), HasSubstr("no group (…)"));
  Put(folder_ / "config.toml", "nesting = \n");
  EXPECT_THAT(Message(), HasSubstr("line 1"));
  Put(folder_ / "config.toml", "nesting = 3\n");
  EXPECT_THAT(Message(), HasSubstr("3 folders deep"));
  fs::remove(folder_ / "config.toml");
  EXPECT_THAT(Message(),
              HasSubstr("neither config.toml (anipose) nor Config.toml (Pose2Sim) nor camera_array.toml (caliscope)"));
}

TEST_F(Anipose, MetresAndGivenUnitsAreKept) {
  Put(folder_ / "config.toml", "nesting = 1\n[calibration]\nboard_square_side_length = 0.025\n");
  InputNotes result;
  EXPECT_EQ(Fill("day1/walk", &result).calib_unit, "");
  EXPECT_THAT(result.warnings, IsEmpty());
  PoseArguments both;
  both.points2d = "a.csv";
  EXPECT_THAT(MessageOf<UsageError>([&] { FillFromProject(folder_.path(), {}, &both, &result); }),
              HasSubstr("either option 'project'"));
}

TEST(CaliscopeProject, TableAndCalibrationComeFromTheFolder) {
  const TempDir folder;
  std::string cameras;
  for (const char* id : {"0", "2"}) {
    cameras += std::string("[cameras.") + id + "]\ncam_id = " + id +
               "\nsize = [640, 480]\nmatrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]\n"
               "distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\ntranslation = [0." +
               id +
               ", 0.0, 2.0]\n"
               "rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n";
  }
  Put(folder / "camera_array.toml", cameras);
  fs::create_directories(folder / "recordings/walk/POSE");
  InputNotes result;
  PoseArguments pose;
  EXPECT_THAT(MessageOf<FormatError>([&] { FillFromProject(folder.path(), {}, &pose, &result); }), HasSubstr("xy_TRACKER.csv"));
  fs::copy_file(Seed("caliscope_points/pose.csv"), folder / "recordings/walk/POSE/xy_POSE.csv");
  EXPECT_EQ(FillFromProject(folder.path(), {}, &pose, &result).take, "walk/POSE");
  const PoseInput input = ReadPoseInput(pose, &result);
  EXPECT_THAT(input.cameras, ElementsAre("cam_0", "cam_2"));
  EXPECT_EQ(input.frames.size(), 3u);
  EXPECT_THAT(input.skeleton.joints, ElementsAre("point_0", "point_11", "point_40"));
}

TEST(TrackerInput, JointsThatACameraLacksAreSaid) {
  const TempDir folder;
  Put(folder / "a.csv", "scorer,S,S,S,S\nbodyparts,nose,nose,tail,tail\ncoords,x,y,x,y\n0,1,2,3,4\n");
  Put(folder / "b.csv", "scorer,S,S\nbodyparts,nose,nose\ncoords,x,y\n0,1,2\n");
  InputNotes result;
  const dataset::Pose2dSet set =
      ReadTrackerFiles({{"a", folder / "a.csv"}, {"b", folder / "b.csv"}}, std::nullopt, {}, &result);
  EXPECT_THAT(set.skeleton.joints, ElementsAre("nose", "tail"));
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].text, HasSubstr("b: its file lacks 1 of 2 joints that other cameras have: tail"));
  const dataset::Pose2dSet sleap = ReadTrackerFiles({{"a", Seed("tracker_hdf5/sleap.h5")}}, std::nullopt, {}, &result);
  EXPECT_EQ(sleap.skeleton.bones.size(), 2u);
}

TEST(TrackerInput, AFileThatIsNotThereIsCalledThat) {
  const TempDir folder;
  Put(folder / "a.csv", "scorer,S,S\nbodyparts,nose,nose\ncoords,x,y\n0,1,2\n");
  InputNotes result;
  const auto read = [&] { ReadTrackerFiles({{"a", folder / "a.csv"}, {"b", folder / "b.csv"}}, std::nullopt, {}, &result); };
  EXPECT_THAT(MessageOf<IoError>(read), HasSubstr("no such file"));
}

}  // namespace
}  // namespace mvstudio::stages
