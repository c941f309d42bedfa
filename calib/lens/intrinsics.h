#pragma once

#include <string>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"
#include "core/status.h"

namespace mvstudio::calib {

/// Focal length (px) of a pinhole with square pixels and the principal point at the image centre, from homographies of
/// boards. Closed form of Zhang, "A flexible new technique for camera calibration", PAMI 2000, with two unknowns fewer.
struct FocalGuess {
  Status status = Status::kOk;  ///< kTooFewViews without views, kDegenerate when all boards are parallel to the image
  double focal_px = 0;
};
FocalGuess GuessFocal(const std::vector<View>& views, int width_px, int height_px);

/// One camera calibrated alone: world is the camera, and every view is a frame of its own.
struct MonoSolution {
  Status status = Status::kOk;
  std::string message;
  RigState state;                      ///< one camera; frame i is views[i]
  std::vector<View> views;             ///< the given ones, in order; weights 0 for rejected corners
  std::vector<Eigen::VectorXd> prior;  ///< the given weights
  BundleReport bundle;
};

/// Initial values and least squares. Starts are the closed form, a few other focal lengths without distortion, and
/// equidistant fisheye lenses of several fields of view. The one that explains the boards best after a short adjustment is
/// kept. `camera` gives name, size and model; without `keep_model` the model is brown4 or kannala4, whichever fits the
/// best start.
MonoSolution CalibrateMono(const geometry::Camera& camera, const std::vector<View>& views, const BundleOptions& options,
                           bool keep_model = true);

/// Same from given intrinsics: poses, then least squares (of the poses alone without refine_intrinsics).
MonoSolution RefineMono(const geometry::Camera& camera, const std::vector<View>& views, const BundleOptions& options);

/// Converts `camera` to another model. Within a family, common parameters are kept and the others are 0; between families,
/// the lens is fitted to the same projection (FitLens).
geometry::Camera WithModel(const geometry::Camera& camera, geometry::LensModel model, const geometry::SplineGrid& spline = {});

/// Largest angle between the optical axis and a corner with a weight, radians.
double LargestAngle(const geometry::Camera& camera, const std::vector<View>& views);

}  // namespace mvstudio::calib
