#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/nets/model.h"
#include "avatar/run/pack/run_config.h"
#include "avatar/run/references/references.h"
#include "avatar/run/render/render_pose.h"
#include "core/fields.h"
#include "core/image.h"
#include "core/progress.h"

/// New images of a trained avatar: any calibrated camera, any pose, an orbiting camera.
namespace mvstudio::avatar {

/// Whether poses of others get the trained person's bone lengths and steps.
enum class ScaleNormalise { kOn, kOff };
/// Where poses of others stand.
enum class RenderPlace {
  kAuto,      ///< kTraining for animation files, else kKeep
  kKeep,      ///< as given
  kTraining,  ///< their middle where the trained person's was
};
enum class RenderFrame {
  kCrop,    ///< square images around the person, as in training
  kCamera,  ///< the whole image of the calibrated camera, through its lens
};
std::string_view ToString(ScaleNormalise scale);  ///< "on", "off"
std::string_view ToString(RenderPlace place);     ///< "auto", "keep", "training"
std::string_view ToString(RenderFrame frame);     ///< "crop", "camera"
/// Throw UsageError.
void FromString(const std::string& text, ScaleNormalise* scale);
void FromString(const std::string& text, RenderPlace* place);
void FromString(const std::string& text, RenderFrame* frame);

struct RenderOptions {
  std::string dataset;
  std::string cameras;
  std::string calib;
  std::string poses;
  std::string bvh;
  int pose_person = -1;
  bool rest_pose = false;
  int every = 1;
  ScaleNormalise scale_normalise = ScaleNormalise::kOn;
  RenderPlace place = RenderPlace::kAuto;
  int turntable = 0;
  double elevation_deg = -1000;
  RenderFrame frame = RenderFrame::kCrop;
  int size_px = 0;
  int network_size_px = 0;
  int batch = 8;
  std::vector<int> frames;  ///< empty: those held out, or all; of another take: all
};

template <class Visitor>
void VisitFields(Visitor&& visit, RenderOptions& o) {
  visit("dataset", o.dataset, "dataset folder, when it is no longer where the training found it");
  visit("cameras", o.cameras,
        "cameras to render, e.g. cam_02,cam_05 (held-out ones too); those held out unless given, or all of option 'calib'");
  visit("calib", o.calib, "calibration file, ours or Panoptic's, whose cameras are rendered instead of the dataset's");
  visit("poses", o.poses,
        "poses of another take or person: a Panoptic sequence, a folder of body3DScene files, one of them, or a folder with "
        "points.csv (pose3d)");
  visit("bvh", o.bvh, "poses of an animation file (Biovision hierarchy)");
  visit("pose-person", o.pose_person, "person id in option 'poses'; -1: the one with most frames");
  visit("rest-pose", o.rest_pose, "the pose of the body template, arms spread, where the trained person was");
  visit("every", o.every, "use every n-th of the frames");
  visit("scale-normalise", o.scale_normalise,
        "on: poses of option 'poses' and option 'bvh' get the trained person's bone lengths and steps; off: they stay as they "
        "are");
  visit("place", o.place,
        "where poses of option 'poses' and option 'bvh' stand: keep (as given), training (their middle where the trained "
        "person's was), or auto: training for option 'bvh', else keep");
  visit("turntable", o.turntable, "images of a camera that orbits the person once; 0: calibrated cameras instead");
  visit("elevation-deg", o.elevation_deg,
        "degrees; elevation of the orbiting camera above the person's middle; -1000: the median of the training cameras");
  visit("frame", o.frame,
        "crop: square images around the person as in training; camera: the whole image of the calibrated camera, through "
        "its lens");
  visit("size", o.size_px, "edge of the square images, px; 0: as in training");
  visit("network-size", o.network_size_px,
        "edge at which the network runs before its images are resized, px, a multiple of 2^downs; 0: as in training");
  visit("batch", o.batch, "images rendered at a time");
}

/// One image to render.
struct RenderJob {
  std::string view;            ///< camera name, or "turn"
  int frame = 0;               ///< frame of the pose, or index of the image on the orbit
  size_t pose = 0;             ///< index into the plan's poses
  geometry::RigCamera camera;  ///< as calibrated
  geometry::RigCamera crop;    ///< what the network sees
};

struct RenderPlan {
  PoseTrack track;
  std::vector<FullPose> joints;  ///< of each pose of the track, in the network's list; hands and face only from its own dataset
  std::vector<RenderJob> jobs;   ///< view by view, each in temporal order
  std::vector<std::string> skipped;
  std::shared_ptr<const body::BodyTemplate> body;      ///< the template that the network sees posed; null: none
  std::shared_ptr<const body::TexturedPerson> fitted;  ///< the person's own body in its place; null: none
  std::shared_ptr<const References> references;        ///< for networks that take some; null: none
  bool HasBody() const { return body || fitted; }
  /// Vertices of the body in a pose; empty when the joints do not determine the trunk.
  std::optional<Eigen::Matrix3Xf> Vertices(const dataset::Coco19Pose& pose) const;
  bool foreign = false;  ///< poses that are not from the training's dataset
  bool scaled = false;   ///< bone lengths were replaced
  double ratio = 1;      ///< trained person's size over that of the poses
  double rate_hz = 0;    ///< images per second of a view; 0: unknown
};

/// The images that `options` request. Poses of the run's own dataset are unchanged, so that its cameras and frames give
/// the images that `avatar eval` scores. Throws UsageError, IoError, FormatError.
RenderPlan MakeRenderPlan(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& options);

/// Renders the plan's images in order: RGBA, colours multiplied by alpha (as seen on black). Methods with memory start
/// without previous images at each view, at each run of frames at the usual distance, and at each cut (dataset/pose/cuts.h).
void RenderImages(AvatarModel& model, const RunConfig& config, const RenderPlan& plan, const RenderOptions& options,
                  const RunContext& run, const std::function<void(const RenderJob&, const Image&)>& on_image);

/// A camera of the size of a crop that looks at `middle_in_world` from `distance_m` away; azimuth from the x axis towards y.
geometry::RigCamera OrbitCamera(const Eigen::Vector3d& middle_in_world, double azimuth_rad, double elevation_rad,
                                double distance_m, int size_px);

}  // namespace mvstudio::avatar
