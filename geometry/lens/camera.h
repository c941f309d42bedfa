#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"
#include "geometry/lens/models.h"
#include "geometry/lens/models/spline_grid.h"

namespace mvstudio::geometry {

std::string_view ToString(LensModel model);
std::optional<LensModel> LensModelFromString(std::string_view name);
/// All names, separated by ", ".
std::string LensModelNames();
/// As an option (core/fields.h): a model's name, or auto for none. Throws UsageError that names `option`.
std::string_view ToString(const std::optional<LensModel>& model);
void FromString(const std::string& text, const std::string& option, std::optional<LensModel>* model);
/// True for models that can see points 90 degrees and more off the axis; the others are perspective.
constexpr bool IsWide(LensModel model) { return TraitsOf(model).wide; }
/// The models with a fixed number of parameters, fewest first.
std::vector<LensModel> ModelsSimplestFirst();
/// The model that is this one with Brown's p1, p2 added, if there is one.
std::optional<LensModel> WithDecentring(LensModel model);

namespace internal {
[[noreturn]] int NoFixedParamCount();
}
/// Throws ContractViolation for kSplined: ask for the count of a Camera.
constexpr int NumDistortionParams(LensModel model) {
  return TraitsOf(model).has_grid ? internal::NoFixedParamCount() : TraitsOf(model).num_params;
}
/// 4 + NumDistortionParams.
constexpr int NumParams(LensModel model) { return 4 + NumDistortionParams(model); }
/// "fx", "fy", "cx", "cy", "k1", … in the order of `Camera::params`. Not for kSplined.
std::vector<std::string> ParamNames(LensModel model);

/// Intrinsics of one camera.
struct Camera {
  std::string name;
  LensModel model = LensModel::kPinhole;
  int width_px = 0;
  int height_px = 0;
  Eigen::VectorXd params;  // (NumParams(camera)): fx, fy, cx, cy px, then the distortion
  SplineGrid spline;       ///< kSplined only

  double fx() const { return params[0]; }
  double fy() const { return params[1]; }
  double cx() const { return params[2]; }
  double cy() const { return params[3]; }
  Eigen::Matrix3d K() const;
};

/// What the model of `camera` demands, also for kSplined, whose names are "fx", …, "cy", "ux_ROW_COL", "uy_ROW_COL".
int NumParams(const Camera& camera);
std::vector<std::string> ParamNames(const Camera& camera);

/// A pinhole camera with the given focal length, principal point at the image centre ((w-1)/2, (h-1)/2).
Camera MakePinhole(const std::string& name, int width_px, int height_px, double focal_px);

/// The pinhole that agrees with `camera` to first order at the optical axis: its focal lengths are px a radian there.
Camera PinholeOf(const Camera& camera);

/// What is wrong with a control grid, or nothing.
std::string WhyInvalidGrid(const SplineGrid& grid);
/// What is wrong with the lens, or nothing: parameter count, finiteness, focal lengths, the control grid, and parameters for
/// which the formula is undefined at the optical axis (xi <= -1, beta <= 0).
std::string WhyInvalidLens(const Camera& camera);
/// OpenCV's k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, those that the lens lacks 0; nothing where it is no special case of
/// OpenCV's perspective lens.
std::optional<Eigen::Matrix<double, 12, 1>> OpenCvTerms(const Camera& camera);
/// True for models whose parameters are the first of those, in that order.
bool HasOpenCvOrder(LensModel model);

/// Throws ContractViolation naming the camera when its sizes or its lens are wrong.
void Validate(const Camera& camera);

struct Projection {
  Status status = Status::kOk;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

struct ProjectionWithJacobians {
  Status status = Status::kOk;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> d_px_d_x = Eigen::Matrix<double, 2, 3>::Zero();  // with respect to x_in_cam
  Eigen::Matrix<double, 2, Eigen::Dynamic> d_px_d_params;                      // with respect to Camera::params
};

struct Unprojection {
  Status status = Status::kOk;
  Eigen::Vector3d ray_in_cam = Eigen::Vector3d::UnitZ();  // unit length
};

/// Projects and unprojects through one camera; computes the valid radius once. Cheap to copy.
class Projector {
 public:
  explicit Projector(const Camera& camera);

  /// `kBehindCamera` for z <= 0 (for wide models: for points on the optical axis behind the camera), `kOutsideValidRadius`
  /// beyond the radius where the distortion folds over or has a pole, or outside a splined lens's control grid;
  /// `kNonFiniteInput`. The pixel may lie outside the image.
  Projection Project(const Eigen::Vector3d& x_in_cam) const;
  /// Dense; inside optimisers ProjectLens of lens_derivatives.h is faster.
  ProjectionWithJacobians ProjectWithJacobians(const Eigen::Vector3d& x_in_cam) const;

  /// Inverse: closed form for ucm, eucm and doublesphere, else a bracketed radial solve; then 2-D Newton with backtracking
  /// where the lens is not radial. Residual below 1e-9 px (or 8 roundings of the pixel's coordinates, or of the ray's angle,
  /// where these are coarser), or a status; never a guess.
  Unprojection Unproject(const Eigen::Vector2d& px) const;

  /// Radius up to which the radial function is defined and increasing: tan(theta) for perspective models, theta (radians, at
  /// most pi) for wide ones; decentring and prism terms are left out of account. Infinity when it never folds. splined: theta
  /// of the largest circle inside the control grid.
  double valid_radius() const { return valid_radius_; }
  const Camera& camera() const { return camera_; }

 private:
  Projection ProjectWide(const Eigen::Vector3d& x_in_cam) const;
  Projection ProjectSplined(const Eigen::Vector3d& x_in_cam) const;
  Projection Formula(const Eigen::Vector3d& x_in_cam) const;
  template <class Lens>
  Unprojection UnprojectWide(const Eigen::Vector2d& px) const;
  template <class Lens>
  Unprojection UnprojectPerspective(const Eigen::Vector2d& px) const;
  Unprojection UnprojectSplined(const Eigen::Vector2d& px) const;

  Camera camera_;
  bool radial_only_ = true;  ///< no asymmetric terms, or all of them 0
  double valid_radius_ = 0;
  double valid_radius_squared_ = 0;
  double max_distorted_radius_ = 0;  ///< radial function at valid_radius_
};

/// One-off forms; use a Projector in loops.
Projection Project(const Camera& camera, const Eigen::Vector3d& x_in_cam);
Unprojection Unproject(const Camera& camera, const Eigen::Vector2d& px);
double ValidRadius(const Camera& camera);

/// True when the pixel lies inside [-0.5, w - 0.5) x [-0.5, h - 0.5).
bool InImage(const Camera& camera, const Eigen::Vector2d& px);

}  // namespace mvstudio::geometry
