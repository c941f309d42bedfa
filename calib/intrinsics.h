#pragma once

#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/view.h"
#include "core/status.h"

namespace mvstudio::calib {

/// Focal length (px) of a pinhole with square pixels and its principal point at the image centre, from the homographies of
/// boards. Zhang, "A flexible new technique for camera calibration", PAMI 2000, closed form with two unknowns fewer.
struct FocalGuess {
  Status status = Status::kOk;  ///< kTooFewViews without views, kDegenerate when all boards are parallel to the image
  double focal_px = 0;
};
FocalGuess GuessFocal(const std::vector<View>& views, int width_px, int height_px);

/// One camera calibrated by itself: world is the camera, RigState has one camera and the frames of its views.
struct MonoSolution {
  Status status = Status::kOk;
  std::string message;
  RigState state;           ///< frames as in the views
  std::vector<View> views;  ///< the given ones; weights 0 for rejected corners
  BundleReport bundle;
};

/// Start and least squares: closed form and a few other focal lengths as starts, the best kept. `camera` gives name, size and
/// model.
MonoSolution CalibrateMono(const geometry::Camera& camera, const std::vector<View>& views, const std::vector<int64_t>& frames,
                           const BundleOptions& options);

/// Least squares from a known solution with another lens model (parameters that both have are kept, others start at 0).
MonoSolution RefineMono(const MonoSolution& start, geometry::LensModel model, const BundleOptions& options);

/// Parameters of `camera` in the terms of another model: kept where both have them, 0 elsewhere. kannala4 starts from the focal
/// length alone.
geometry::Camera WithModel(const geometry::Camera& camera, geometry::LensModel model);

}  // namespace mvstudio::calib
