// Private: the steps of VerifyDataset, some of which the import repeats.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/footage/mask_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify.h"

namespace mvstudio::dataset::internal {

/// Returns the cameras that are readable.
geometry::Rig VerifyCalibration(const std::string& path, Findings* findings);

/// Returns the readable scenes, by frame.
std::map<int, Body3dScene> VerifyScenes(const PanopticFrames& frames, Findings* findings);

/// Checks the joints of another skeleton beside the scenes; the number of its readable files. `skeleton`: its name.
int VerifyOwnJoints(const std::string& root, const std::map<int, Body3dScene>& scenes, std::string* skeleton,
                    Findings* findings);

/// Number of readable files of faces or hands.
enum class LandmarkKind { kFaces, kHands };
int VerifyLandmarks(const PanopticFrames& frames, LandmarkKind kind, const std::map<int, Body3dScene>& scenes,
                    Findings* findings);

/// Checks sync tables, and whether they agree with the times of the joints.
void VerifySyncTables(const PanopticSequence& sequence, const std::map<int, Body3dScene>& hd_scenes, Findings* findings);

/// An image reduced to a few grey means, to detect cameras that show the same.
using Thumbnail = std::array<float, 16 * 16>;
Thumbnail MakeThumbnail(const Image& image);

struct FootageCheck {
  int64_t images = 0, masks = 0, videos = 0;  ///< decoded
  int64_t frames = 0;                         ///< existing, or listed as missing
  int no_image = 0, no_mask = 0;              ///< frames with joints without an image; with an image and without a mask
  std::map<int, Thumbnail> thumbnails;        ///< of a few frames
};
/// Pixels in the image of the valid joints.
struct ProjectedJoints {
  std::vector<Eigen::Vector2d> px;
  int valid = 0;
};
ProjectedJoints ProjectJoints(const std::map<int, Coco19Pose>& people, const geometry::RigCamera& camera,
                              const geometry::Projector& projector);

/// How many of a camera's joints lie on its masks, as they are, mirrored left to right, and rotated by 180 degrees.
struct MaskCover {
  int on_mask = 0, seen = 0, mirrored = 0, rotated = 0;
  /// Of masks with joints in view: how many, those of nobody, of nearly the whole image, and of more than half of it, but no
  /// joint.
  int masks = 0, empty = 0, whole = 0, inverted = 0;
  void Add(const Image& mask, const ProjectedJoints& joints);
  void Report(const std::string& folder, double least_cover, Findings* findings) const;  ///< DAT-COVER
};

/// Reports masks of other values than 0 and 255; null where they contradict each other or are no masks.
std::optional<MaskMeaning> VerifyMaskValues(const PanopticSequence& sequence, Findings* findings);

/// Checks images or the video, and masks, of one camera. `scenes`: of its kind. Without `masks`, what masks show is not
/// looked at.
FootageCheck VerifyImages(const PanopticSequence& sequence, const geometry::RigCamera& camera, const PanopticFootage& footage,
                          const std::map<int, Body3dScene>& scenes, const std::optional<MaskMeaning>& masks,
                          const VerifyOptions& options, Findings* findings);
FootageCheck VerifyVideo(const geometry::RigCamera& camera, const PanopticFootage& footage,
                         const std::map<int, Body3dScene>& scenes, const VerifyOptions& options, Findings* findings);

/// A camera's check and its findings as bytes. Reading throws DamagedBytes.
std::string BytesOfCheck(const FootageCheck& check, const std::vector<Finding>& findings);
FootageCheck CheckFromBytes(const std::string& bytes, Findings* findings);

/// Finds cameras whose footage is that of another, and numbers of frames that differ within a kind.
void CompareCameras(const std::vector<geometry::RigCamera>& cameras, const std::vector<FootageCheck>& checks,
                    const PanopticSequence& sequence, Findings* findings);

}  // namespace mvstudio::dataset::internal
