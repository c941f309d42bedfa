#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// One image of one camera.
struct SceneImage {
  std::string camera, path;
  geometry::Camera lens;                                          ///< what is known of it: all parameters, or a guess
  bool lens_known = false;                                        ///< the lens is fixed
  std::optional<Eigen::MatrixXd> lens_covariance = std::nullopt;  ///< (P, P) of a known lens; empty: unknown
};

struct ColmapOptions {
  std::string program = "colmap";  ///< its path, or a name to look for in PATH
  int max_features = 8192;         ///< maximum per image
};

template <class Visitor>
void VisitFields(Visitor&& visit, ColmapOptions& o) {
  visit("colmap", o.program, "the colmap program: a path, or a name to look for in PATH");
  visit("max-features", o.max_features, "features of an image at most");
}

/// A feature track entry: one image's observation of one point.
struct ColmapTrackPoint {
  int image_idx = 0;  ///< into ColmapScene::rig's cameras
  int point_idx = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the top-left pixel
};

struct ColmapScene {
  geometry::Rig rig;        ///< the images that were registered, named by their camera; the unit of length is arbitrary
  Eigen::Matrix3Xd points;  ///< (3, N)
  std::vector<ColmapTrackPoint> tracks;
};

/// True when colmap supports the lens.
bool ColmapCanCarry(geometry::LensModel model);

/// A lens of about 66 degrees diagonally (focal length 1.2 times the longer side), for images without any information.
geometry::Camera GuessLens(const std::string& camera, int width_px, int height_px);

/// Runs the colmap program in `work_folder`, which is created: SIFT features on the CPU, exhaustive matching and
/// incremental mapping (Schoenberger and Frahm, CVPR 2016). Its output goes to `work_folder`/colmap.log. Known lenses are
/// fixed; other images of one size share a lens. Returns an empty scene when no two images match. Throws MissingToolError
/// without colmap, IoError when it fails.
ColmapScene RunColmap(const std::vector<SceneImage>& images, const std::string& work_folder, const ColmapOptions& options,
                      const RunContext& run);

/// Points and tracks of a binary model: images by name, and the point of each feature.
ColmapScene ReadColmapScene(const std::string& folder);

}  // namespace mvstudio::calib
