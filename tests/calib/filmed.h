#pragma once

#include <cmath>
#include <vector>

#include "tests/calib/synthetic.h"

/// A board that moves smoothly before cameras that may be late.
namespace mvstudio::calib::testing {

/// Pose of the board in camera 0 at a time step (frames), waved smoothly.
inline geometry::Rigid3 Waved(double t) {
  geometry::Rigid3 cam0_from_board;
  cam0_from_board.rotation =
      geometry::RotationExp({0.5 * std::sin(0.09 * t), 0.5 * std::sin(0.07 * t + 1), 0.4 * std::sin(0.05 * t + 2)});
  const Eigen::Vector3d centre(0.25 * std::sin(0.08 * t + 3), 0.2 * std::sin(0.1 * t), 1.15 + 0.25 * std::sin(0.06 * t + 1));
  cam0_from_board.translation = centre - cam0_from_board.rotation * Eigen::Vector3d(0.24, 0.15, 0);
  return cam0_from_board;
}

/// Camera c takes image f, whose number is 10 + stride * f, at the time step stride * f * (1 + rate[c]) + late[c].
inline Scene Film(const std::vector<double>& late, int num_frames, double noise_px, uint64_t seed = 1,
                  const std::vector<double>& rate = {}, int stride = 1) {
  SceneOptions options;
  options.num_cameras = static_cast<int>(late.size()), options.num_frames = num_frames;
  Scene scene = MakeScene(options);
  const geometry::Rigid3 world_from_cam0 = geometry::Inverse(scene.truth.cam_from_world[0]);
  scene.detections.clear();
  Rng rng(seed);
  for (size_t c = 0; c < late.size(); ++c) {
    for (int f = 0; f < num_frames; ++f) {
      scene.truth.frames[f] = stride * f + 10;
      const double time_step = stride * f * (1 + (rate.empty() ? 0 : rate[c])) + late[c];
      scene.truth.world_from_board[f] = world_from_cam0 * Waved(time_step);
      const Detection seen = Observe(scene, static_cast<int>(c), f, noise_px, &rng);
      if (seen.num_corners() > 0) scene.detections.push_back(seen);
    }
  }
  for (int f = 0; f < num_frames; ++f) scene.truth.world_from_board[f] = world_from_cam0 * Waved(stride * f);
  return scene;
}

/// Options that look for clocks that run differently.
inline CalibrateOptions WithClocks() {
  CalibrateOptions options = PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  options.time_offset = TimeOffsetChoice::kAuto;
  return options;
}

}  // namespace mvstudio::calib::testing
