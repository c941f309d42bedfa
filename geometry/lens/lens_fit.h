#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/status.h"
#include "geometry/lens/camera.h"

/// A lens in the terms of another model: for file formats that lack a model, and as the start of an adjustment.
namespace mvstudio::geometry {

struct LensFitOptions {
  int grid_cols = 32;    ///< pixels, whose rays are reproduced, over the image's width; as many rows as its shape asks for
  double max_angle = 0;  ///< rad; rays farther off the axis are left out; 0: all that the lens sees
  int max_iterations = 200;
  bool keep_principal_point = false;  ///< hold the pixel of the optical axis
  /// Let the new lens look in a direction of its own. Control points of a splined lens can hide a rotation of some degrees,
  /// which no radial model can copy; the camera's cam_from_world has to follow `new_from_old`. Not for a splined `to`.
  bool fit_rotation = false;
};

struct LensFit {
  Status status = Status::kOk;  ///< kTooFewViews: too few rays; kDegenerate: no start; kNotConverged: not at an optimum
  Camera camera;                ///< name and size of `from`
  Eigen::Quaterniond new_from_old = Eigen::Quaterniond::Identity();  ///< turns rays of `from` into rays of `camera`
  double rms_px = 0;                                                 ///< 2-D point RMS over the rays that both lenses see
  double max_px = 0;
  int num_rays = 0;
  int num_lost = 0;      ///< of num_rays, those outside the new lens's valid radius: not in rms_px and max_px; 0 for a good fit
  double max_angle = 0;  ///< rad, of the rays used
};

/// Parameters of the model `to` that map the rays of `from`, over its image, to the same pixels: least squares in px by
/// Levenberg-Marquardt with QR, from closed-form and scanned starts that agree with `from` on the axis; linear least squares
/// with `from`'s own axis for the control points of a splined model, which needs its grid `spline`. A perspective model gets
/// rays up to 80 degrees only. Throws ContractViolation for an invalid camera or grid.
LensFit FitLens(const Camera& from, LensModel to, const LensFitOptions& options = {}, const SplineGrid& spline = {});

/// The lens that looks like a pinhole `from` on its axis, in the middle of each of several minima that an adjustment under
/// model `to` may fall into; none for models with one.
std::vector<Camera> BasinStarts(const Camera& from, LensModel to);

/// A control grid with `cols` columns that holds every ray of `from` over its image with 5 % to spare, in whole degrees.
SplineGrid SplineGridFor(const Camera& from, int order, int cols);

}  // namespace mvstudio::geometry
