#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/fields.h"
#include "core/image.h"
#include "core/progress.h"
#include "core/status.h"
#include "dataset/panoptic/panoptic.h"
#include "geometry/rig/rig.h"

/// Matches the colours of a studio's cameras. A point of a person's surface should have the same colour in all cameras
/// that see it; systematic differences are exposure, white balance and black level. The model is the simplest that
/// held-out points justify: none, a gain, or a gain and an offset for each channel of each camera. These act in linear
/// light or on the stored sRGB values.
namespace mvstudio::dataset {

enum class ColourModel { kNone, kGain, kGainOffset };
enum class ColourSpace { kLinear, kSrgb };
std::string ToString(ColourModel model);  ///< "none", "gain", "gain+offset"
std::string ToString(ColourSpace space);  ///< "linear", "srgb"

/// The model and the space that are asked for; kAuto: by points held out of the fit.
enum class ColourModelChoice { kAuto, kNone, kGain, kGainOffset };
enum class ColourSpaceChoice { kAuto, kLinear, kSrgb };
std::string_view ToString(ColourModelChoice choice);
std::string_view ToString(ColourSpaceChoice choice);
/// Throw UsageError.
void FromString(const std::string& text, ColourModelChoice* choice);
void FromString(const std::string& text, ColourSpaceChoice* choice);

struct ColourMatchOptions {
  ColourModelChoice model = ColourModelChoice::kAuto;
  ColourSpaceChoice space = ColourSpaceChoice::kAuto;
  std::string reference;
  int frames = 16;
  int points = 800;
  double voxel_m = 0.02;
  double patch_m = 0.012;
  int min_overlap = 60;
};

template <class Visitor>
void VisitFields(Visitor&& visit, ColourMatchOptions& o) {
  visit("colour-model", o.model, "auto (by points held out of the fit), none, gain, gain+offset");
  visit("colour-space", o.space, "auto (by points held out of the fit), linear, srgb: where gain and offset act");
  visit("colour-reference", o.reference, "camera that stays as it is; empty: the geometric mean of the gains is 1");
  visit("colour-frames", o.frames, "frames, spread over the take, whose images are compared");
  visit("colour-points", o.points, "surface points of a frame, at most");
  visit("colour-voxel", o.voxel_m, "metres; grid of the visual hull; larger is faster and loses thin parts");
  visit("colour-patch", o.patch_m, "metres; radius on the surface over which a colour is averaged");
  visit("colour-min-overlap", o.min_overlap, "points that two cameras must share to be compared");
}

/// A point of a person's surface and its colour in the cameras that see it.
struct ColourPoint {
  int frame = 0;
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres
  struct View {
    int camera_idx = 0;
    Eigen::Array3d srgb = Eigen::Array3d::Zero();     ///< 0..1; NaN in channels with clipped values
    Eigen::Array3d as_seen = Eigen::Array3d::Zero();  ///< 0..1, with the clipped values as they are
  };
  std::vector<View> views;  ///< two or more
};

/// Converts a camera's values to common ones: common = gain * own + offset, on values 0..1 of the match's space.
struct ColourTransform {
  Status status = Status::kOk;  ///< kTooFewViews: too few points in common with the others; unchanged
  Eigen::Array3d gain = Eigen::Array3d::Ones();
  Eigen::Array3d offset = Eigen::Array3d::Zero();
  Eigen::Array3d gain_sigma = Eigen::Array3d::Zero();  ///< standard deviation of the gain
  int points = 0;                                      ///< that the camera shares with others
  bool IsIdentity() const { return (gain == 1).all() && (offset == 0).all(); }
};

/// One model tested on the held-out points.
struct ColourTrial {
  ColourModel model = ColourModel::kNone;
  ColourSpace space = ColourSpace::kSrgb;
  Status status = Status::kOk;    ///< kDegenerate: the colours do not determine its parameters
  double heldout_levels = 0;      ///< median distance of a camera's colour from the mean of the others, grey levels of 255
  double heldout_gain = 0;        ///< reduction of the squared error (clipped) against no model, 0..1
  double heldout_gain_sigma = 0;  ///< its standard error over groups of points
};

struct ColourMatch {
  /// kTooFewViews: no cameras share enough points; kDegenerate, kNotConverged: the colours do not determine the requested
  /// model. Colours then stay unchanged.
  Status status = Status::kOk;
  std::string reason;  ///< one sentence: why this model, or why none
  ColourModel model = ColourModel::kNone;
  ColourSpace space = ColourSpace::kSrgb;
  std::vector<ColourTransform> cameras;  ///< in the rig's order
  std::vector<ColourTrial> trials;
  int points = 0;
};

/// RGB image, or mask, of a camera and frame; empty where there is none.
using ImageSource = std::function<Image(int camera_idx, int frame)>;

/// Surface points from the visual hull of the silhouettes (Laurentini, PAMI 1994), each with the cameras that see it at
/// less than 60 degrees from its normal and without occlusion by the hull. Deterministic for a given input and seed.
std::vector<ColourPoint> SampleSurfaceColours(const geometry::Rig& rig, const std::map<int, std::map<int, Coco19Pose>>& poses,
                                              const ImageSource& images, const ImageSource& masks,
                                              const ColourMatchOptions& options, const RunContext& run);

/// Gain and offset of each camera from points that several see, by robust maximum likelihood. The points' true colours are
/// unknowns, so noise does not bias the gains low. Names are for `options.reference` and messages. Throws UsageError for
/// unknown models or cameras.
ColourMatch MatchColours(const std::vector<ColourPoint>& points, const std::vector<std::string>& camera_names,
                         const ColourMatchOptions& options = {});

/// Both of the above on a dataset with masks.
ColourMatch MatchDatasetColours(const PanopticDataset& dataset, const ColourMatchOptions& options, const RunContext& run);

/// Applies the camera's transform to the image; rounded, clipped to 0..255.
void ApplyColour(const ColourTransform& transform, ColourSpace space, Image* rgb);

/// JSON object with model, space, cameras and trials, as docs/colour.md describes it.
std::string ColourMatchToJsonText(const ColourMatch& match, const std::vector<std::string>& camera_names);

}  // namespace mvstudio::dataset
