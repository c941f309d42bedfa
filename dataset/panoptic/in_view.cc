#include "dataset/panoptic/in_view.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::dataset {
namespace {

constexpr double kLeastRadiusM = 0.2;  // of a studio's rig

/// Joints of a frame that are known, and whether one of them lies in an image.
int KnownJoints(const std::map<int, Coco19Pose>& people, const geometry::Rig& rig, bool* in_view) {
  int known = 0;
  for (const auto& [id, pose] : people) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j]) continue;
      ++known;
      for (size_t c = 0; c < rig.cameras.size() && !*in_view; ++c) {
        const geometry::Camera& camera = rig.cameras[c].camera;
        const auto at =
            geometry::Projector(camera).Project(rig.cameras[c].cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
        *in_view = at.status == Status::kOk && InImage(camera, at.px);
      }
    }
  }
  return known;
}

}  // namespace

double RigRadiusM(const geometry::Rig& rig) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& camera : rig.cameras) mean += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  double radius_m = 0;
  for (const auto& camera : rig.cameras) radius_m = std::max(radius_m, (camera.CenterInWorld() - mean).norm());
  return radius_m;
}

std::string MetresConflict(const geometry::Rig& rig) {
  const double radius_m = RigRadiusM(rig);
  if (rig.cameras.size() < 3 || !(radius_m < kLeastRadiusM)) return "";
  return Format("all cameras are within %.3g cm of their middle; Panoptic files are in centimetres, are these metres?",
                100 * radius_m);
}

NotInView WhyNotInView(const geometry::Rig& rig, const std::map<int, std::map<int, Coco19Pose>>& poses) {
  bool in_view = false;
  int joints = 0, frames = 0;
  const auto step = static_cast<int>(std::max<size_t>(1, poses.size() / 32));
  int position = 0;
  for (const auto& [frame, people] : poses) {
    if (position++ % step != 0) continue;
    const int known = KnownJoints(people, rig, &in_view);
    if (in_view) return {};
    joints += known, frames += known > 0;
  }
  if (joints == 0 || rig.cameras.empty()) return {};
  const double radius_m = RigRadiusM(rig);
  const std::string of = Format("no joint of %d frames lies in the image of any of %zu cameras", frames, rig.cameras.size());
  if (rig.cameras.size() >= 2 && radius_m < kLeastRadiusM)
    return {true, "DAT-UNITS: " + of +
                      Format(", and all cameras are within %.3g cm of their middle: t is in centimetres in "
                             "Panoptic's files, is it in metres here? Multiply each t by 100",
                             100 * radius_m)};
  return {false, "DAT-VIEW: " + of + ": are calibration and joints of one take, in one world, in centimetres?"};
}

void RequireInView(const PanopticDataset& dataset, bool units_only) {
  const NotInView why = WhyNotInView(dataset.rig, dataset.poses);
  if (why.text.empty() || (units_only && !why.is_units)) return;
  throw FormatError(FindPanopticCalibration(dataset.root), "", why.text + " (`mvstudio dataset verify` lists all)");
}

}  // namespace mvstudio::dataset
