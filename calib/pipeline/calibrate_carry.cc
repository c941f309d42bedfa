#include <cmath>

#include "calib/pipeline/calibrate_steps.h"
#include "geometry/rig/rig_covariance.h"

/// What the calibration file carries on: covariances and time offsets.
namespace mvstudio::calib::internal {
namespace {

using Eigen::Index;

/// Cameras with corners that took part.
std::vector<bool> CamerasSeen(const Work& work) {
  std::vector<bool> seen(work.state.cameras.size(), false);
  for (const View& view : work.evidence) {
    if ((view.weights.array() > 0).any()) seen[static_cast<size_t>(view.camera_idx)] = true;
  }
  return seen;
}

/// A held block of a camera without corners, which has no column of its own: as it was given.
void KeepGiven(const HeldCovariance& held, size_t camera, geometry::StatedCovariance* stated) {
  const Index lens = stated->begin[camera], pose = stated->PoseRow(camera), from = held.stated.begin[camera];
  const auto keep = [&](Index to, Index first, Index count) {
    stated->joint.block(to, to, count, count) = held.stated.joint.block(first, first, count, count);
  };
  if (held.lens[camera]) keep(lens, from, pose - lens);
  if (held.pose[camera]) keep(pose, held.stated.PoseRow(camera), 6);
}

/// A camera's offset, and its rate, as the file states them: from frame 0 on.
geometry::TimeOffset OffsetAtFrame0(const RigCovariance& covariance, const Work& work, size_t camera) {
  const RigState& state = work.state;
  const Index column = covariance.columns.time[camera];
  const double variance = column >= 0 ? covariance.joint(column, column) : 0;
  geometry::TimeOffset offset{0.0 - state.time_offset_frames[camera], std::sqrt(variance)};
  if (state.time_rate.empty()) return offset;
  offset.rate = 0.0 - state.time_rate[camera];
  offset.frames -= offset.rate * state.clock_frame;
  if (column < 0) return offset;
  const Eigen::Vector2d at_0(1, -state.clock_frame);
  offset.sigma_frames = std::sqrt(at_0.dot(covariance.joint.block<2, 2>(column, column) * at_0));
  offset.sigma_rate = std::sqrt(covariance.joint(column + 1, column + 1));
  return offset;
}

/// Frame `f + offset` of a camera that is late by d shows the same as the others' frame f: its image f is of time step f +
/// d.
void StoreTimeOffsets(const RigCovariance& covariance, const Work& work, geometry::Rig* rig) {
  for (size_t c = 0; c < work.state.time_offset_frames.size(); ++c) {
    const int column = covariance.columns.time[c];
    if (static_cast<int>(c) != work.bundle.time_reference && column < 0) continue;  // no board moved in its sight
    rig->cameras[c].time_offset = OffsetAtFrame0(covariance, work, c);
  }
}

}  // namespace

void StoreCalibrationCovariance(const RigCovariance& covariance, const HeldCovariance& held, const Work& work,
                                geometry::Rig* rig) {
  const RigColumns& columns = covariance.columns;
  const std::vector<bool> seen = CamerasSeen(work);
  geometry::StatedCovariance stated;
  stated.joint = JointCovariance(covariance, work.state);
  stated.begin = {0};
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    stated.begin.push_back(stated.begin.back() + work.state.cameras[c].params.size() + 6);
    const bool fixed = c < work.bundle.fix_camera.size() && work.bundle.fix_camera[c];
    const bool frame = seen[c] && columns.camera[c] < 0 && !fixed;  // what the gauge fixes, or a camera in a frame of its own
    stated.lens_known.push_back(columns.lens[c] >= 0 || held.lens[c]);
    stated.pose_known.push_back(columns.camera[c] >= 0 || held.pose[c] || frame);
    if (!seen[c] && (held.lens[c] || held.pose[c])) KeepGiven(held, c, &stated);
  }
  stated.correlated = true;
  geometry::StoreCovariance(stated, rig);
  StoreTimeOffsets(covariance, work, rig);
}

}  // namespace mvstudio::calib::internal
