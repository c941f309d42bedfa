#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "avatar/splats/cloud.h"
#include "geometry/rig/rig.h"

/// Gaussians of space as Gaussians of an image: Zwicker et al., "EWA Splatting", TVCG 2002.
namespace mvstudio::splats {

/// Smallest share of a pixel's light that counts: where a Gaussian covers less, it covers nothing.
inline constexpr double kLeastAlpha = 1.0 / 255;
/// Largest: what lies behind always gets a rest, so that opacities keep a gradient.
inline constexpr double kMostAlpha = 0.99;
/// Nearer means are left out, metres.
inline constexpr double kNearPlane = 0.05;

struct RenderSettings {
  /// The 2D Mip filter of Yu et al., "Mip-Splatting", CVPR 2024: a variance of 0.1 px^2 that keeps the light of a Gaussian.
  /// Off: 0.3 px^2 that adds light, as in Kerbl et al., 2023.
  bool mip = true;
  int num_threads = 1;  ///< 0: as many as the machine has; the result does not depend on it
};

/// A pinhole camera in precision S.
template <class S>
struct PinholeView {
  int width = 0, height = 0;
  S fx = 0, fy = 0, cx = 0, cy = 0;                // px
  Eigen::Matrix<S, 3, 3> cam_from_world;           // rotation
  Eigen::Matrix<S, 3, 1> world_in_cam;             // its translation, metres
  Eigen::Matrix<S, 3, 1> center_in_world;          // metres
  S low_x = 0, high_x = 0, low_y = 0, high_y = 0;  // x / z and y / z at which the projection is linearised lie between these
};

/// Throws ContractViolation for a camera that is no pinhole, or has no size.
template <class S>
PinholeView<S> ViewOf(const geometry::RigCamera& camera);

/// The posed triangles.
template <class S>
struct Surface {
  const Eigen::Matrix3Xi& faces;                        // (3, F)
  const Eigen::Matrix<S, 3, Eigen::Dynamic>& vertices;  // (3, V) metres, world
};

/// A Gaussian in an image.
template <class S>
struct Splat {
  S x = 0, y = 0;         ///< px
  S a = 0, b = 0, c = 0;  ///< inverse covariance [a b; b c], px^-2
  S opacity = 0;          ///< at its middle, before kMostAlpha
  S rgb[3] = {0, 0, 0};
  S depth = 0;                 ///< z in cam, metres
  S reach_x = 0, reach_y = 0;  ///< px: half the box outside which it covers less than kLeastAlpha
  int index = 0;               ///< in the cloud
};

/// Gaussians that cannot be shown.
struct SkippedSplats {
  int64_t degenerate = 0;     ///< on a triangle without area
  int64_t behind_camera = 0;  ///< nearer than kNearPlane
  int64_t not_finite = 0;     ///< a parameter or a vertex is not
};

template <class S>
struct Projected {
  std::vector<Splat<S>> splats;  ///< those that touch the image, in the order of the cloud
  SkippedSplats skipped;
};

template <class S>
Projected<S> ProjectSplats(const BasicCloud<S>& cloud, const Surface<S>& surface, const PinholeView<S>& view,
                           const RenderSettings& settings);

extern template PinholeView<float> ViewOf(const geometry::RigCamera&);
extern template PinholeView<double> ViewOf(const geometry::RigCamera&);
extern template Projected<float> ProjectSplats(const BasicCloud<float>&, const Surface<float>&, const PinholeView<float>&,
                                               const RenderSettings&);
extern template Projected<double> ProjectSplats(const BasicCloud<double>&, const Surface<double>&, const PinholeView<double>&,
                                                const RenderSettings&);

}  // namespace mvstudio::splats
