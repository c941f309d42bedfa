#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "calib/points/colmap_program.h"
#include "calib/points/point_bundle.h"
#include "calib/points/point_clusters.h"
#include "calib/points/scene_points.h"

namespace mvstudio::calib {

/// Points with known coordinates that some of the cameras see: marked points, or the corners of a board that does not
/// move.
struct KnownPoints {
  std::vector<std::string> names;
  Eigen::Matrix3Xd x_in_world;  ///< (3, N) metres
  struct Click {
    std::string camera;
    int point_idx = 0;
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
  };
  std::vector<Click> clicks;
  double sigma_px = 1;  ///< per coordinate
  geometry::RigGauge gauge;
};

KnownPoints KnownFromScenePoints(const ScenePoints& points, double click_sigma_px);
/// The corners of the board in the frame that most cameras saw; world is the board's frame. `camera_names` are indexed by
/// Detection::camera_idx.
KnownPoints KnownFromBoard(const Board& board, const std::vector<Detection>& detections,
                           const std::vector<std::string>& camera_names);

struct SceneScale {
  std::optional<KnownPoints> points;  ///< used first: they give frame and scale
  struct Distance {
    std::string a, b;
    double distance_m = 0, sigma_m = 0;
  };
  std::optional<Distance> distance;  ///< used otherwise: it gives the scale, and camera a the frame
};

/// "A:B:1.234m" (mm, cm, m). Throws UsageError.
SceneScale::Distance ParseCameraDistance(const std::string& text);

struct FromSceneOptions {
  ColmapOptions colmap;
  bool refine_intrinsics = true;  ///< focal length, k1, k2 of unknown lenses; cameras of one image size share them, unless
                                  ///< held-out points favour own lenses
  double reject_sigmas = 6;
};

template <class Visitor>
void VisitFields(Visitor&& visit, FromSceneOptions& o) {
  VisitFields(visit, o.colmap);
  visit("refine-unknown-lenses", o.refine_intrinsics,
        "option 'from-scene': adjust focal length, k1 and k2 of lenses that option 'start' does not give");
  visit("scene-reject-sigmas", o.reject_sigmas, "option 'from-scene': standard deviations beyond which a feature is rejected");
}

struct FromSceneReport {
  Status status = Status::kOk;       ///< kTooFewViews, kDegenerate, kNotConverged
  std::string message;               ///< one line when the status is not kOk
  geometry::Rig rig;                 ///< with covariances, when the status allows
  std::vector<std::string> missing;  ///< cameras that could not be placed
  PointBundleReport bundle;
  bool own_lenses = false;         ///< held-out points favour separate lenses for cameras whose lenses were unknown
  int num_points = 0;              ///< with at least two kept observations
  std::vector<int> num_seen;       ///< per camera of the rig: kept features
  ClusterInflation clusters;       ///< factor applied to the covariances, because errors of neighbouring features are
                                   ///< correlated
  double feature_sigma_px = 0;     ///< standard deviation of a feature per coordinate, as estimated
  double colmap_rms_px = 0;        ///< 2-D RMS of all features before the adjustment, with colmap's cameras
  std::vector<std::string> gross;  ///< known points that disagree
};

/// Rig from colmap's model: scaled and rotated by the known quantities, then an adjustment of cameras, unknown lenses and
/// points, with covariances.
FromSceneReport AdjustScene(const ColmapScene& scene, const std::vector<SceneImage>& images, const SceneScale& scale,
                            const FromSceneOptions& options, const RunContext& run);

/// Similarity from the scene's unit and frame to those of the known points: each that two cameras see is triangulated.
/// kTooFewViews when fewer than 3 are, kDegenerate when they are collinear.
struct SceneSimilarity {
  Status status = Status::kOk;
  std::string message;
  double scale = 1;                   ///< metres per unit of the scene
  geometry::Rigid3 world_from_scene;  ///< x_in_world = R (scale x_in_scene) + t
  double rms_m = 0;
  int num_points = 0;
};
SceneSimilarity AlignScene(const geometry::Rig& rig, const KnownPoints& known);

}  // namespace mvstudio::calib
