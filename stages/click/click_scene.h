#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/points/point_resection.h"
#include "calib/points/scene_points.h"
#include "core/image.h"
#include "geometry/lens/camera.h"

/// Points with known places that are clicked in one image of each camera: what a page shows of them, what it sends back, and
/// how well the clicks agree with the lenses.
namespace mvstudio::stages {

struct ClickCamera {
  std::string name;
  int width_px = 0, height_px = 0;
  std::string jpeg;                      ///< bytes of the image
  std::optional<geometry::Camera> lens;  ///< where it is known; residuals need it
};

/// (camera, point) -> px; (0, 0) is the centre of the top-left pixel.
using ClickMap = std::map<std::pair<int, int>, Eigen::Vector2d>;

struct ClickScene {
  std::vector<ClickCamera> cameras;
  std::vector<std::string> names;  ///< of the points
  Eigen::Matrix3Xd x_in_world;     ///< (3, N) metres
  ClickMap clicks;
  int64_t revision = 0;  ///< counts what was saved: clicks that were made on an older one must not replace these
};

/// Adds a camera with its image (RGB or grey). Throws UsageError for a name that is there already, and for a lens of another
/// image size.
void AddCamera(const std::string& name, const Image& image, const std::optional<geometry::Camera>& lens, ClickScene* scene);

/// Points, and the clicks that an earlier table has of cameras that the scene has; those of other cameras are returned.
std::vector<std::string> AddPoints(const calib::ScenePoints& points, ClickScene* scene);

/// {"cameras": [{name, width, height, has_lens}], "points": [{name, x, y, z}]} and what ClicksJsonText holds: the page reads
/// it.
std::string SceneJsonText(const ClickScene& scene, const calib::PointResectionOptions& options);

/// What a page sends: {"revision": n, "clicks": [{"camera": i, "point": j, "x": px, "y": px}]}.
struct SentClicks {
  int64_t revision = -1;  ///< of the scene on which they were made; -1: not stated
  ClickMap clicks;        ///< all that the page has
};
/// Throws FormatError for anything else: unknown indices, a pair twice, a place outside the image.
SentClicks ReadSentClicks(const std::string& json_text, const ClickScene& scene);

/// How well the clicks of one camera agree (calib::ResectFromPoints).
struct ClickFit {
  Status status = Status::kTooFewViews;
  std::string message;  ///< one line when the status is not kOk
  int num_clicks = 0;
  double rms_px = 0, leave_one_out_px = 0;      ///< NaN: not known
  std::map<int, Eigen::Vector2d> residual_px;   ///< by point: observed minus projected
  std::vector<int> rejected;                    ///< points
  std::map<int, Eigen::Vector2d> predicted_px;  ///< by point: where the placed camera sees it, inside the image
};
ClickFit FitClicks(const ClickScene& scene, int camera_idx, const calib::PointResectionOptions& options);
/// {"revision": n, "clicks": […], "fits": […]}: what is saved, and how well it agrees.
std::string ClicksJsonText(const ClickScene& scene, const calib::PointResectionOptions& options);

/// The table camera,point,x_px,y_px, as `calib::ReadScenePoints` reads it; a comment says that mvstudio wrote it.
std::string ClicksCsv(const ClickScene& scene);

}  // namespace mvstudio::stages
