#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/result.h"
#include "stages/words.h"

/// 2D joints whose numbers mean something else than pixels of the calibrated image, from its top-left corner, by frames of one
/// rate. Every command that reads 2D joints takes these changes.
namespace mvstudio::stages {

/// Cameras by name; all of them with `all`.
struct CameraSet {
  bool all = false;
  std::vector<std::string> names = {};

  bool Has(const std::string& camera) const;
  bool IsEmpty() const { return !all && names.empty(); }
};
/// "" is all cameras, "a,b" these two.
std::string ToString(const CameraSet& cameras);
void FromString(const std::string& text, const std::string& option, CameraSet* cameras);

/// A value of all cameras, or of one.
struct CameraValue {
  std::string camera;  ///< empty: all that have none of their own
  std::string value;
};
/// "VALUE" or "CAMERA=VALUE".
std::string ToString(const CameraValue& value);
void FromString(const std::string& text, const std::string& option, CameraValue* value);

/// In the order in which they are made.
struct PoseChanges {
  std::vector<std::string> swap_cameras;     ///< "A,B": these two bear each other's name
  std::vector<std::string> without_cameras;  ///< their detections are left out
  bool ignore_scores = false;                ///< every joint that has coordinates counts as seen
  CameraSet normalized;                      ///< coordinates are 0 to 1 of the image's width and height
  CameraSet flip_y;                          ///< y counts from the lower edge: y becomes height - y
  CameraSet flip_x;                          ///< the images are mirrored: x becomes width - 1 - x
  CameraSet swap_sides;             ///< left and right joints bear each other's name, as detectors make it of mirrored images
  std::vector<CameraValue> rotate;  ///< 90, 180, 270: degrees clockwise by which the images are turned; turned back
  std::vector<CameraValue> image_size;  ///< WIDTHxHEIGHT of the images, where they are scaled against the calibrated ones
  std::vector<CameraValue> rate;        ///< frames a second; only their ratios matter
  std::string frames = {};              ///< "80-99" or "1,4,7-9", as the files number them: the others are left out; empty: all
};

/// Leaves out what is not of `changes.frames`. Throws what KnownFrames does; says what is beyond the last frame.
void LimitFrames(const PoseChanges& changes, std::vector<dataset::Pose2dTrack>* tracks, CommandResult* result);
/// The same for the numbers of the frames of all cameras.
std::vector<int> LimitFrames(const PoseChanges& changes, const std::vector<int>& there, CommandResult* result);

/// Time steps a second after ApplyChanges, where rates were given; else 0.
double StepRateHz(const PoseChanges& changes);

/// Changes the tracks, which must be whole takes where rates are given. Time steps then count at the rate that is given for all
/// cameras, else at the lowest. Throws UsageError for cameras without 2D joints and for values that make no sense.
void ApplyChanges(const PoseChanges& changes, const geometry::Rig& rig, const geometry::Skeleton& skeleton,
                  std::vector<dataset::Pose2dTrack>* tracks);

/// Throws FormatError where two cameras at different places have the same detections: one file was given for both.
/// `pose2d` and `points2d` say where the tracks come from.
void RefuseEqual(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Rig& rig,
                 const std::vector<NamedPath>& pose2d, const std::string& points2d);

}  // namespace mvstudio::stages
