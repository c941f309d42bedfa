#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"

namespace mvstudio::geometry {

/// Central lens models. Parameters always start with fx, fy, cx, cy (px); then those of the distortion, OpenCV's in OpenCV's
/// order. Pixel (0, 0) is the centre of the top-left pixel. A name ending in "_p" is the model with decentring p1, p2 added at
/// the end.
enum class LensModel {
  kPinhole,          ///< "pinhole":   no distortion
  kBrown1,           ///< "brown1":    k1
  kBrown2,           ///< "brown2":    k1, k2
  kBrown4,           ///< "brown4":    k1, k2, p1, p2
  kBrown5,           ///< "brown5":    k1, k2, p1, p2, k3
  kRational8,        ///< "rational8": k1, k2, p1, p2, k3, k4, k5, k6
  kKannalaBrandt4,   ///< "kannala4":  k1, k2, k3, k4 of theta_d = theta (1 + k1 theta^2 + … + k4 theta^8)
  kThinPrism12,      ///< "thinprism12": k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4
  kUcm,              ///< "ucm":       xi; unified model (Mei and Rives, ICRA 2007; OpenCV's omnidir)
  kEucm,             ///< "eucm":      alpha, beta; extended unified model (Khomutenko, Garcia, Martinet, RA-L 2016)
  kDoubleSphere,     ///< "doublesphere": xi, alpha (Usenko, Demmel, Cremers, 3DV 2018)
  kPinholeP,         ///< "pinhole_p": p1, p2
  kBrown1P,          ///< "brown1_p":  k1, p1, p2
  kKannalaBrandt4P,  ///< "kannala4_p": k1, k2, k3, k4, p1, p2
  kUcmP,             ///< "ucm_p":    xi, p1, p2; omnidir with k1 = k2 = 0
  kEucmP,            ///< "eucm_p":   alpha, beta, p1, p2
  kDoubleSphereP,    ///< "doublesphere_p": xi, alpha, p1, p2
  kSplined,  ///< "splined": mrcal's LENSMODEL_SPLINED_STEREOGRAPHIC; control points du_x, du_y of Camera::spline, row by row
};

/// Every model; the splined one, whose parameter count depends on its grid, comes last.
inline constexpr LensModel kAllLensModels[] = {LensModel::kPinhole,        LensModel::kBrown1,          LensModel::kBrown2,
                                               LensModel::kBrown4,         LensModel::kBrown5,          LensModel::kRational8,
                                               LensModel::kKannalaBrandt4, LensModel::kThinPrism12,     LensModel::kUcm,
                                               LensModel::kEucm,           LensModel::kDoubleSphere,    LensModel::kPinholeP,
                                               LensModel::kBrown1P,        LensModel::kKannalaBrandt4P, LensModel::kUcmP,
                                               LensModel::kEucmP,          LensModel::kDoubleSphereP,   LensModel::kSplined};

std::string_view ToString(LensModel model);
std::optional<LensModel> LensModelFromString(std::string_view name);
/// All names, separated by ", ".
std::string LensModelNames();
/// True for models that can see points 90 degrees and more off the axis: kannala4, ucm, eucm, doublesphere, their variants,
/// splined.
constexpr bool IsWide(LensModel model) {
  constexpr bool kWide[] = {false, false, false, false, false, false, true, false, true,
                            true,  true,  false, false, true,  true,  true, true,  true};
  return kWide[static_cast<int>(model)];
}
/// The models with a fixed number of parameters, fewest first.
std::vector<LensModel> ModelsSimplestFirst();

namespace internal {
[[noreturn]] int NoFixedParamCount();
}
/// Throws ContractViolation for kSplined: ask for the count of a Camera.
constexpr int NumDistortionParams(LensModel model) {
  constexpr int kCounts[] = {0, 1, 2, 4, 5, 8, 4, 12, 1, 2, 2, 2, 3, 6, 3, 4, 4};
  return model == LensModel::kSplined ? internal::NoFixedParamCount() : kCounts[static_cast<int>(model)];
}
/// 4 + NumDistortionParams.
constexpr int NumParams(LensModel model) { return 4 + NumDistortionParams(model); }
/// "fx", "fy", "cx", "cy", "k1", … in the order of `Camera::params`. Not for kSplined.
std::vector<std::string> ParamNames(LensModel model);

/// Control grid of a splined lens, in mrcal's terms: cols x rows control points at equal distances in the stereographic plane
/// u = 2 tan(theta / 2) (x, y) / |(x, y)|, centred on the axis; fov_x_deg is the horizontal field of view between the borders
/// where the spline still has all its control points (1 of them beyond for order 3, half a distance for order 2).
struct SplineGrid {
  int order = 3;      ///< degree of the B-spline, 2 or 3
  int cols = 0;       ///< mrcal's Nx, at least order + 1
  int rows = 0;       ///< mrcal's Ny, at least order + 1
  int fov_x_deg = 0;  ///< 1 … 359

  int NumControlParams() const { return 2 * cols * rows; }
  bool operator==(const SplineGrid& o) const {
    return order == o.order && cols == o.cols && rows == o.rows && fov_x_deg == o.fov_x_deg;
  }
};

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

namespace internal {
/// Distortion parameters by their role, zeros where a model has none.
struct LensTerms {
  std::array<double, 6> radial{};  ///< k1 … k6; kannala4: k1 … k4; ucm: xi; eucm: alpha, beta; doublesphere: xi, alpha
  double p1 = 0, p2 = 0;
  std::array<double, 4> prism{};  ///< s1 … s4
};
}  // namespace internal

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
  Unprojection UnprojectWide(const Eigen::Vector2d& px) const;
  Unprojection UnprojectPerspective(const Eigen::Vector2d& px) const;
  Unprojection UnprojectSplined(const Eigen::Vector2d& px) const;

  Camera camera_;
  LensModel family_ = LensModel::kPinhole;  ///< of the radial function, see radial.h
  internal::LensTerms terms_;
  bool radial_only_ = true;
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
