#include <cmath>

#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_files.h"
#include "tests/fuzz/fuzz.h"

/// CMU Panoptic's files. What is read and written again reads the same and writes the same text.
namespace mvstudio::fuzz {
namespace {

/// `parse` gives a value of which `ToText` is the text; text -> value -> text ends after one round.
template <class Parse>
void RunText(std::string_view bytes, Parse parse) {
  std::string text;
  if (!Accepts([&] { text = ToText(parse(bytes)); })) return;
  std::string again;
  Require(Accepts([&] { again = ToText(parse(text)); }), "what was written cannot be read");
  Require(again == text, "the text changes when it is read and written again");
}

void RunRig(std::string_view bytes) {
  const std::string path = InMemory("calibration_fuzz.json", bytes);
  geometry::Rig rig;
  Accepts([&] { dataset::ReadAnyCalibration(path); });
  if (!Accepts([&] { rig = dataset::ReadPanopticCalibration(path); })) return;
  for (const geometry::RigCamera& camera : rig.cameras) {
    Require(geometry::WhyInvalidLens(camera.camera).empty(), "an invalid lens was accepted");
    int panel = 0, node = 0;
    if (!dataset::ParsePanopticName(camera.camera.name, &panel, &node)) return;
  }
  const std::string out = MemoryPath("calibration_out.json");
  if (!Accepts([&] { dataset::WritePanopticCalibration(rig, out, "fuzz"); })) return;
  const geometry::Rig back = dataset::ReadPanopticCalibration(out);
  Require(back.cameras.size() == rig.cameras.size(), "the number of cameras changed");
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const geometry::RigCamera &a = rig.cameras[i], &b = back.cameras[i];
    Require(a.camera.name == b.camera.name && a.camera.params == b.camera.params, "a lens changed");
    Require(a.cam_from_world.translation == b.cam_from_world.translation, "a translation changed");
    Require(a.cam_from_world.rotation.angularDistance(b.cam_from_world.rotation) < 1e-7, "a rotation changed");
  }
}

void RunJoints(std::string_view bytes) {
  const std::string path = InMemory("body3DScene_00000001.json", bytes);
  dataset::Body3dScene scene;
  if (!Accepts([&] { scene = dataset::ReadBody3dSceneFile(path); })) return;
  const std::string out = MemoryPath("body3DScene_00000002.json");
  dataset::WriteBody3dScene(scene.people, scene.univ_time_ms, out);
  const dataset::Body3dScene back = dataset::ReadBody3dSceneFile(out);
  Require(back.people.size() == scene.people.size(), "the number of people changed");
  for (const auto& [id, pose] : scene.people) {
    const auto found = back.people.find(id);
    Require(found != back.people.end() && found->second.valid == pose.valid, "a person changed");
    for (int j = 0; j < 19; ++j) {
      for (int k = 0; k < 3; ++k) {
        Require(Near(pose.x_in_world(k, j), found->second.x_in_world(k, j), 1e-9), "a joint moved");
      }
    }
  }
}

}  // namespace

MVS_FUZZ_TARGET(panoptic_calibration, bytes) {
  RunText(bytes, [](std::string_view text) { return dataset::ParsePanopticCalibration(text, "calibration.json"); });
  RunRig(bytes);
}

MVS_FUZZ_TARGET(body3d_scene, bytes) {
  RunText(bytes, [](std::string_view text) { return dataset::ParsePanopticScene(text, "scene.json"); });
  RunJoints(bytes);
}

MVS_FUZZ_TARGET(panoptic_landmarks, bytes) {
  RunText(bytes, [](std::string_view text) { return dataset::ParsePanopticLandmarks(text, "face.json"); });
}

MVS_FUZZ_TARGET(panoptic_sync_tables, bytes) {
  RunText(bytes, [](std::string_view text) { return dataset::ParsePanopticSyncTables(text, "synctables.json"); });
}

}  // namespace mvstudio::fuzz
