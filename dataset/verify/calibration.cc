#include <cmath>
#include <set>

#include "dataset/json/json_file.h"
#include "dataset/panoptic/in_view.h"
#include "dataset/panoptic/panoptic_camera.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"
#include "geometry/rig/plausible.h"

namespace mvstudio::dataset::internal {
namespace {

void CheckPanel(const PanopticCamera& camera, const std::string& path, const std::string& where, Findings* findings) {
  int panel = 0, node = 0;
  if (!ParsePanopticName(camera.name, &panel, &node)) {
    return findings->Error("DAT-NAME", path, where + ".name: " + Quoted(camera.name) + " is not of the form 00_00");
  }
  if (!camera.panel || !camera.node) findings->Warning("DAT-NAME", path, where + ": panel or node is missing");
  const std::string kind = ToString(KindOfPanel(panel)), type = kind == "kinect" ? "kinect-color" : kind;
  if (!camera.type) {
    findings->Warning("DAT-CALIB", path, where + ".type: is missing");
  } else if (*camera.type != type) {
    findings->Warning(
        "DAT-CALIB", path,
        where + ".type: is " + Quoted(*camera.type) + ", cameras of panel " + std::to_string(panel) + " are '" + type + "'");
  }
}

void VerifyCamera(const JsonView& json, const std::string& path, std::set<std::string>* names, geometry::Rig* rig,
                  std::vector<PanopticCamera>* all, Findings* findings) {
  const PanopticCamera& fields = all->emplace_back(ReadPanopticCameraFields(json));
  CheckPanel(fields, path, json.where(), findings);
  double drift = 0;
  const geometry::RigCamera camera = ToRigCamera(fields, path, json.where(), &drift);
  if (drift > 1e-6)
    findings->Warning("DAT-CALIB", path, json.where() + ".R: is " + NumberText(drift) + " from the nearest rotation");
  if (!names->insert(fields.name).second)
    return findings->Error("DAT-NAME", path, json.where() + ".name: " + Quoted(fields.name) + " is there twice");
  if (geometry::ShareWithoutRay(camera.camera) > 0) {
    findings->Warning("DAT-LENS", path,
                      json.where() + ".distCoef: the lens folds over inside the image; its corners have no ray");
  }
  rig->cameras.push_back(camera);
}

/// Folds and units have words of their own here.
void CheckPlausible(const geometry::Rig& rig, const std::string& path, Findings* findings) {
  for (const Notice& conflict : geometry::ConflictsIn(rig)) {
    if (conflict.code == "CAL-FOLD" || (conflict.code == "CAL-DISTANCES" && rig.cameras.size() >= 3)) continue;
    findings->Warning("DAT-CALIB", path, conflict.text);
  }
}

/// What only all cameras together show.
void CheckPlaces(const geometry::Rig& rig, const std::string& path, Findings* findings) {
  const std::string metres = MetresConflict(rig);
  if (!metres.empty()) findings->Warning("DAT-UNITS", path, metres);
  std::map<std::array<double, 7>, std::string> places;
  for (const auto& camera : rig.cameras) {
    const auto& q = camera.cam_from_world.rotation.coeffs();
    const auto& t = camera.cam_from_world.translation;
    const auto [at, is_new] =
        places.emplace(std::array<double, 7>{q[0], q[1], q[2], q[3], t[0], t[1], t[2]}, camera.camera.name);
    if (!is_new) {
      findings->Warning("DAT-CALIB", path,
                        "cameras " + at->second + " and " + camera.camera.name + " have the same place and direction");
    }
  }
}

}  // namespace

geometry::Rig VerifyCalibration(const std::string& path, Findings* findings) {
  geometry::Rig rig;
  rig.gauge.kind = geometry::RigGauge::Kind::kPanoptic, rig.gauge.words = "calibration";
  try {
    const Json json = ParseJsonFile(path, kMaxCalibrationBytes);
    const JsonView cameras = JsonView(path, json)["cameras"];
    std::set<std::string> names;
    std::vector<PanopticCamera> all;
    constexpr size_t kMostTold = 100, kHopeless = 10000;
    size_t unreadable = 0;
    if (cameras.ArraySize() == 0) cameras.Fail("is empty");
    for (size_t i = 0; i < cameras.ArraySize(); ++i) {
      try {
        VerifyCamera(cameras[i], path, &names, &rig, &all, findings);
      } catch (const FormatError& error) {
        if (++unreadable <= kMostTold) findings->Error("DAT-CALIB", path, WithoutPath(error));
        if (unreadable == kHopeless) cameras.Fail("more than " + std::to_string(kHopeless) + " of them cannot be read");
      }
    }
    if (unreadable > kMostTold)
      findings->Error("DAT-CALIB", path, std::to_string(unreadable - kMostTold) + " more cameras cannot be read");
    for (const PanopticNameConflict& conflict : PanopticNameConflicts(all)) {
      const auto tell = conflict.exchanged ? &Findings::Error : &Findings::Warning;
      (findings->*tell)("DAT-NAME", path, conflict.text);
    }
  } catch (const FormatError& error) {
    findings->Error("DAT-CALIB", path, WithoutPath(error));
  }
  if (!rig.cameras.empty()) CheckPlaces(rig, path, findings), CheckPlausible(rig, path, findings);
  return rig;
}

}  // namespace mvstudio::dataset::internal
