#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"

namespace mvstudio::geometry {

/// Central lens models. Parameters always start with fx, fy, cx, cy (px); then the distortion in OpenCV's order.
/// Pixel (0, 0) is the centre of the top-left pixel.
enum class LensModel {
  kPinhole,         ///< "pinhole":   no distortion
  kBrown1,          ///< "brown1":    k1
  kBrown2,          ///< "brown2":    k1, k2
  kBrown4,          ///< "brown4":    k1, k2, p1, p2
  kBrown5,          ///< "brown5":    k1, k2, p1, p2, k3
  kRational8,       ///< "rational8": k1, k2, p1, p2, k3, k4, k5, k6
  kKannalaBrandt4,  ///< "kannala4":  k1, k2, k3, k4 of theta_d = theta (1 + k1 theta^2 + … + k4 theta^8)
};

inline constexpr LensModel kAllLensModels[] = {LensModel::kPinhole,       LensModel::kBrown1, LensModel::kBrown2,
                                               LensModel::kBrown4,        LensModel::kBrown5, LensModel::kRational8,
                                               LensModel::kKannalaBrandt4};

std::string_view ToString(LensModel model);
std::optional<LensModel> LensModelFromString(std::string_view name);
constexpr int NumDistortionParams(LensModel model) {
  constexpr int kCounts[] = {0, 1, 2, 4, 5, 8, 4};
  return kCounts[static_cast<int>(model)];
}
/// 4 + NumDistortionParams.
constexpr int NumParams(LensModel model) { return 4 + NumDistortionParams(model); }
/// "fx", "fy", "cx", "cy", "k1", … in the order of `Camera::params`.
std::vector<std::string> ParamNames(LensModel model);

/// Intrinsics of one camera.
struct Camera {
  std::string name;
  LensModel model = LensModel::kPinhole;
  int width_px = 0;
  int height_px = 0;
  Eigen::VectorXd params;  // (NumParams(model)): fx, fy, cx, cy px, then the distortion

  double fx() const { return params[0]; }
  double fy() const { return params[1]; }
  double cx() const { return params[2]; }
  double cy() const { return params[3]; }
  Eigen::Matrix3d K() const;
};

/// A pinhole camera with the given focal length, principal point at the image centre ((w-1)/2, (h-1)/2).
Camera MakePinhole(const std::string& name, int width_px, int height_px, double focal_px);

/// Throws ContractViolation naming the camera when sizes, parameter count, focal lengths or finiteness are wrong.
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

  /// `kBehindCamera` for z <= 0 (for kannala4: for points on the optical axis behind the camera), `kOutsideValidRadius` beyond
  /// the radius where the distortion folds over, `kNonFiniteInput`. The pixel may lie outside the image.
  Projection Project(const Eigen::Vector3d& x_in_cam) const;
  ProjectionWithJacobians ProjectWithJacobians(const Eigen::Vector3d& x_in_cam) const;

  /// Inverse by a bracketed radial solve and 2-D Newton with backtracking: residual below 1e-9 px (or 8 roundings of the
  /// pixel's coordinates where that is coarser, beyond some 5e5 px), or a status; never a guess.
  Unprojection Unproject(const Eigen::Vector2d& px) const;

  /// Undistorted radius up to which the radial function is monotone: tan(theta) for the polynomial and rational models, theta
  /// (radians, at most pi) for kannala4. Infinity when it never folds.
  double valid_radius() const { return valid_radius_; }
  const Camera& camera() const { return camera_; }

 private:
  using Distortion = std::array<double, 8>;  // k1, k2, p1, p2, k3 … k6, zero where the model has none; kannala4: k1 … k4

  Projection ToPixel(double a, double b) const;
  Unprojection UnprojectFisheye(const Eigen::Vector2d& px) const;
  Unprojection UnprojectPerspective(const Eigen::Vector2d& px) const;
  bool RefineUndistorted(const Eigen::Vector2d& px, Eigen::Vector2d* ab) const;
  Eigen::Vector2d Distort(double a, double b, Eigen::Matrix2d* jacobian) const;

  Camera camera_;
  LensModel formula_ = LensModel::kPinhole;  ///< kBrown5 stands for all Brown models, with zeros
  double fx_ = 1, fy_ = 1, cx_ = 0, cy_ = 0;
  Distortion k_{};
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
