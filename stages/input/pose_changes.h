#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/input_notes.h"
#include "stages/words.h"
#include "triangulate/take/share_range.h"

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
  CameraSet normalized;                      ///< coordinates are shares of the image's width and height
  CameraSet flip_y;                          ///< y counts from the lower edge: y becomes height - y
  CameraSet flip_x;                          ///< the images are mirrored: x becomes width - 1 - x
  CameraSet swap_sides;             ///< left and right joints bear each other's name, as detectors make it of mirrored images
  std::vector<CameraValue> rotate;  ///< 90, 180, 270: degrees clockwise by which the images are turned; turned back
  std::vector<CameraValue> image_size;        ///< WIDTHxHEIGHT of the images, where they are scaled against the calibrated ones
  std::vector<CameraValue> rate;              ///< frames a second; only their ratios matter
  std::vector<CameraValue> first_frame = {};  ///< number that the files give the footage's first frame, which becomes 0
  std::map<std::string, triangulate::ShareRange> shares = {};  ///< no option: by camera, of a take that is read in parts
  std::string frames = {};  ///< "80-99" or "1,4,7-9", as the files number them: the others are left out; empty: all
};

template <class Visitor>
void VisitFields(Visitor&& visit, PoseChanges& o) {
  StartGroup(visit, "What the 2D joints mean");
  VisitStyled(visit, OptionStyle::kCameras, "normalized", o.normalized,
              "coordinates are 0 to 1 of the image's width and height, or -1 to 1, or percent, as their range tells; of all "
              "cameras, or of those "
              "named, with commas");
  VisitStyled(visit, OptionStyle::kCameras, "flip-y", o.flip_y,
              "y counts from the lower edge, as in DLTdv and Argus: y becomes height - y");
  VisitStyled(visit, OptionStyle::kCameras, "flip-x", o.flip_x, "the images were mirrored: x becomes width - 1 - x");
  VisitStyled(visit, OptionStyle::kCameras, "swap-sides", o.swap_sides,
              "left and right joints bear each other's name, as a detector calls them in mirrored images");
  visit("rotate", o.rotate,
        "90, 180 or 270, or CAMERA=90: degrees clockwise by which the images were turned against the calibration's; the "
        "joints are turned back");
  visit("image-size", o.image_size,
        "WIDTHxHEIGHT, or CAMERA=WIDTHxHEIGHT: of the images in which the joints were found, where they are scaled against "
        "the calibrated ones");
  visit("rate", o.rate, "HZ, or CAMERA=HZ: frames a second, where cameras differ; time steps count at HZ, else at the lowest");
  visit(
      "first-frame", o.first_frame,
      "NUMBER, or CAMERA=NUMBER: what the files call the footage's first frame, which becomes frame 0; 1 is found where other "
      "cameras or the footage tell");
  visit("frames", o.frames, "80-99 or 1,4,7-9: frames, as the files number them; all unless given");
  visit("swap-cameras", o.swap_cameras, "A,B: the 2D joints of these two cameras bear each other's name");
  VisitStyled(visit, OptionStyle::kList, "without-camera", o.without_cameras,
              "names of cameras, with commas, whose 2D joints are left out");
  VisitStyled(visit, OptionStyle::kSwitch, "ignore-scores", o.ignore_scores,
              "every joint that has coordinates counts as seen with score 1");
}

/// What the coordinates of joints that are seen count, where they are no pixels.
triangulate::ShareRange SharesOf(const dataset::Pose2dTrack& track);

/// Leaves out what is not of `changes.frames`. Throws what KnownFrames does; says what is beyond the last frame.
void LimitFrames(const PoseChanges& changes, std::vector<dataset::Pose2dTrack>* tracks, InputNotes* notes);
/// The same for the numbers of the frames of all cameras.
std::vector<int> LimitFrames(const PoseChanges& changes, const std::vector<int>& there, InputNotes* notes);

/// By `changes.first_frame`; 0 where nothing is said. Throws UsageError for what is no whole number.
int FirstFrameOf(const PoseChanges& changes, const std::string& camera);

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
