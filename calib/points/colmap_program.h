#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// One picture of one camera.
struct SceneImage {
  std::string camera, path;
  geometry::Camera lens;    ///< what is known of it: all, or a guess
  bool lens_known = false;  ///< the lens is kept
  std::optional<Eigen::MatrixXd> lens_covariance = std::nullopt;  ///< (P, P) of a known lens; nothing: unknown
};

struct ColmapOptions {
  std::string program = "colmap";  ///< its path, or a name to look for in PATH
  int max_features = 8192;         ///< of an image
};

template <class Visitor>
void VisitFields(Visitor&& visit, ColmapOptions& o) {
  visit("colmap", o.program, "the colmap program: a path, or a name to look for in PATH");
  visit("max-features", o.max_features, "features of an image at most");
}

/// A feature that colmap tracked: where an image shows which point.
struct ColmapTrackPoint {
  int image_idx = 0;  ///< into ColmapScene::rig's cameras
  int point_idx = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the top-left pixel
};

struct ColmapScene {
  geometry::Rig rig;        ///< the images that were placed, named by their camera; the unit of length is arbitrary
  Eigen::Matrix3Xd points;  ///< (3, N)
  std::vector<ColmapTrackPoint> tracks;
};

/// True when colmap can carry the lens.
bool ColmapCanCarry(geometry::LensModel model);

/// A lens of 66 degrees diagonally or so (focal length 1.2 times the longer side), for images of which nothing is known.
geometry::Camera GuessLens(const std::string& camera, int width_px, int height_px);

/// SIFT features on the CPU, exhaustive matching and incremental mapping by the colmap program (Schoenberger and Frahm, CVPR
/// 2016) in `work_folder`, which is created; its output goes to `work_folder`/colmap.log. Lenses that are known are kept; the
/// other images of one size share one. An empty scene when no two images fit together. Throws MissingToolError when there is no
/// colmap, IoError when it fails.
ColmapScene RunColmap(const std::vector<SceneImage>& images, const std::string& work_folder, const ColmapOptions& options,
                      const RunContext& run);

/// Points and tracks of a binary model: the images, by name, and which feature of each shows which point.
ColmapScene ReadColmapScene(const std::string& folder);

}  // namespace mvstudio::calib
