#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "avatar/body/fit/mask_outline.h"
#include "avatar/body/fit/person_body.h"
#include "avatar/body/fit/photometric.h"
#include "core/progress.h"
#include "geometry/rig/rig.h"

/// A template's skeleton and surface fitted to one person's joints, silhouettes and, where given, brightness.
namespace mvstudio::body {

/// The person in one image.
struct FitView {
  std::string camera_name;
  geometry::RigCamera camera;
  std::shared_ptr<const MaskOutline> outline;
  std::shared_ptr<const Image> grey;  ///< brightness (H, W, 1); null: outlines alone
  bool held_out = false;              ///< it judges the fit and takes no part in it until the end
};

/// One time step.
struct FitStep {
  int frame = 0;
  JointObservation joints;
  std::vector<FitView> views;
};

struct BodyFitOptions {
  bool fit_surface = true;  ///< off: the lengths of the bones alone
  bool use_brightness = true;
  double joint_sigma_m = 0;  ///< 0: estimated from the joints' distances from the posed skeleton, at least 3 mm
};

/// One step of the fit.
struct BodyFitStage {
  std::string name;
  double held_out_iou = 0;  ///< mean over held-out silhouettes, posed by joints alone
  double seconds = 0;       ///< since the start
  bool kept = false;
};

/// What the silhouettes of one camera say.
struct CameraFit {
  std::string name;
  int views = 0, rejected = 0;
  double iou_before = 0, iou = 0;                      ///< means over its silhouettes
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< of its silhouettes against the fitted body
  double shift_sigma_px = 0;
};

struct RejectedView {
  int frame = 0;
  std::string camera;
  double iou = 0;
};

struct BodyFit {
  Status status = Status::kOk;  ///< kTooFewViews: no time step with a trunk and a silhouette; then `person` is the template
  PersonBody person;
  Eigen::VectorXd coefficients;  ///< (S) of the template's shapes
  Eigen::VectorXd offsets;       ///< (V) metres along the rest normals
  /// (V) standard deviations of `offsets`, metres, given the poses; at 0.03 m nothing is known. Empty without offsets.
  Eigen::VectorXd offset_sigma_m;
  double iou_before = 0, iou = 0;     ///< held-out silhouettes, posed by joints alone: the template, the fitted body
  std::vector<double> held_out_loss;  ///< (steps) 1 - IoU of the fitted body as above; NaN where nothing is held out
  double joint_error_m = 0;           ///< median distance of joints from the posed skeleton
  std::vector<BodyFitStage> stages;
  std::vector<CameraFit> cameras;
  std::vector<RejectedView> rejected;        ///< silhouettes far from all others' agreement
  std::optional<MeanBrightness> brightness;  ///< of the fitted body, where poses by brightness were kept
};

/// Holds out every image of a fifth of the time steps, in four blocks; with fewer than ten time steps every fourth image, and
/// nothing of fewer than four images.
void HoldOutViews(std::vector<FitStep>* steps);

BodyFit FitBody(const BodyTemplate& body, const std::vector<FitStep>& steps, const BodyFitOptions& options,
                const RunContext& run);

/// Intersection over union of a posed body and a silhouette.
double SilhouetteIou(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const FitView& view);

}  // namespace mvstudio::body
