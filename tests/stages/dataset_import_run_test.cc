#include <filesystem>

#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "geometry/rig/rig_io.h"
#include "stages/dataset_import/describe.h"
#include "tests/calib/synthetic.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

geometry::Rig PanopticRig() {
  calib::testing::SceneOptions scene;
  scene.num_frames = 2;
  geometry::Rig rig = calib::testing::TruthRig(calib::testing::MakeScene(scene));
  rig.cameras[0].camera.name = "00_00", rig.cameras[1].camera.name = "00_01";
  return rig;
}

/// Frames with joints of nobody and no footage: the session is made, with the cameras where they are, and both are said.
TEST(DatasetImportStage, FramesOfNobodyAreAnErrorAndTheCamerasStay) {
  const TempDir folder;
  const geometry::Rig rig = PanopticRig();
  std::filesystem::create_directories(folder / "seq");
  dataset::WritePanopticCalibration(rig, folder / "seq/calibration_seq.json", "test");
  for (const char* frame : {"00000004", "00000005"}) {
    Put(folder / "seq/hdPose3d_stage1_coco19/body3DScene_" + frame + ".json",
        R"({"version": 0.7, "univTime": 53541.5, "fpsType": "hd_29_97", "bodies": []})");
  }
  DatasetImportOptions options;
  options.folder = folder / "seq", options.out = folder / "session";
  const DatasetImportReport report = RunDatasetImport(options);
  EXPECT_EQ(report.imported.first_frame, 4);
  EXPECT_EQ(report.imported.last_frame, 5);
  const geometry::Rig kept = geometry::ReadRig(folder / "session/calib/calibration.json");
  ASSERT_EQ(kept.cameras.size(), 2u);
  EXPECT_LT((kept.cameras[1].CenterInWorld() - rig.cameras[1].CenterInWorld()).norm(), 1e-6);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitQualityGate);
  EXPECT_EQ(said.errors.at(0).code, "DAT-POSE");
  EXPECT_EQ(said.warnings.at(0).code, "DAT-IMAGE");
  EXPECT_EQ(said.metrics["frames"], 2);
  EXPECT_THAT(said.inputs, ElementsAre(options.folder));
  EXPECT_THAT(said.text, HasSubstr("joints of 2 frames (4 to 5), 0 people at most"));
}

TEST(DatasetImportStage, WhatWasLeftOutMakesItPartial) {
  DatasetImportReport report;
  report.imported.cameras_with_footage = 1;
  report.imported.findings = {{dataset::Finding::Severity::kError, "DAT-IMAGE", "a.png", "is broken"}};
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_EQ(said.metrics["findings"].size(), 1u);
}

TEST(DatasetImportStage, AFolderWithoutASequenceIsRefused) {
  const TempDir folder;
  DatasetImportOptions options;
  options.folder = folder.path(), options.out = folder / "session";
  EXPECT_NE(MessageOf<Error>([&] { RunDatasetImport(options); }), "");
  EXPECT_FALSE(std::filesystem::exists(options.out));
}

}  // namespace
}  // namespace mvstudio::stages
