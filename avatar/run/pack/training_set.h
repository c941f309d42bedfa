#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "avatar/data/pack.h"
#include "avatar/run/pack/body_shape.h"
#include "avatar/run/pack/joint_source.h"
#include "core/choice/option_group.h"
#include "core/fields.h"
#include "core/progress.h"
#include "dataset/panoptic/missing.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

/// What poses the body in an image.
enum class PoseBy {
  kJoints,  ///< the 19 joints alone, as for a motion that nobody filmed
  kImages,  ///< the images of the training cameras too, where the fitted body holds such a pose
};
std::string_view ToString(PoseBy pose_by);
void FromString(const std::string& text, PoseBy* pose_by);

/// Options for making crops from a dataset's images. Use the same ones for training and evaluation.
struct TrainingSetOptions {
  int size_px = 128;
  double fill = 0.97;
  int person = -1;
  bool template_maps = true;
  bool fit_shape = true;
  int fit_images = 24;
  int template_input_px = 0;      ///< edge of the pack's template_maps: the image size of their network; 0: none
  bool template_colours = false;  ///< the pack gets the colours of `fitted` at that size
  double half_extent_m = 0;
  int num_joints = 19;  ///< the list of joints that the network's inputs need: LayoutOf(inputs).num_joints
  std::string pose3d;
  std::string iuv;
  std::vector<std::string> cameras;  ///< Panoptic or studio names; empty: all
  std::vector<int> frames;           ///< frame numbers; empty: all with a pose of the person
  int frame_step = 0;                ///< difference of the numbers of consecutive frames; 0: the usual one of `frames`
  /// The person's own body in place of the template: maps and labels show it, and the pack gets body_images.
  std::shared_ptr<const body::TexturedPerson> fitted;
  PoseBy pose_by = PoseBy::kImages;  ///< of the fitted body, in maps for the network and in body_images
  bool keep_views = false;           ///< TrainingSet::views; needs `fitted`
  BodyShape shape;                   ///< girth of the template: start of the fit, or the value when fit_shape is off
};

template <class Visitor>
void VisitFields(Visitor&& visit, TrainingSetOptions& o) {
  StartGroup(visit, "Data");
  visit("size", o.size_px, "edge of the square crops, px");
  visit("fill", o.fill, "share of the crop that the largest poses of the person (98 % quantile of all poses) fill");
  visit("person", o.person, "person id in the dataset; -1: the one with most frames");
  visit("pose3d", o.pose3d,
        "folder with points.csv (`triangulate`): toes, heels, hands and face for option 'inputs' 21, 24 and 27, beside the "
        "dataset's own files");
  StartGroup(visit, "Body");
  visit(
      "pose-by", o.pose_by,
      "what poses the fitted body: images (of the training cameras, held-out frames included), or joints alone, as in a motion "
      "that nobody filmed");
  visit("fit-shape", o.fit_shape, "fit the girth of the body template to the masks");
  StartGroup(visit, "Data");
  visit("iuv", o.iuv,
        "folder with DensePose's map of each image, CAMERA/PICTURE.png (I, U, V as OpenCV's first, second and third channel): "
        "the first guess in place of the posed body template");
  StartGroup(visit, "Body");
  visit("fit-pictures", o.fit_images, "training images used for that fit");
}

/// Disjoint halves of the cameras and of the frames of one dataset. Held-out scores use held-out cameras in held-out frames.
struct DatasetSplit {
  std::vector<std::string> train_cameras, holdout_cameras;  ///< Panoptic names
  std::vector<int> train_frames, holdout_frames;            ///< with a pose of the person
  std::vector<std::string> validation_cameras;              ///< used to choose among weights, never for the final score; may
                                                            ///< be empty
  std::vector<int> validation_frames;
};

/// Everything that is not held out is used for training; with `train_cameras`, of the cameras only those, and the others
/// are not used at all. Frames without the person are on neither side. Throws UsageError for a camera in both lists, for
/// names and frames that the dataset lacks, and when nothing is left for training or of the held-out frames.
DatasetSplit SplitDataset(const dataset::PanopticDataset& data, int person, const std::vector<std::string>& holdout_cameras,
                          const std::vector<int>& holdout_frames, const std::vector<std::string>& train_cameras = {});

/// The person to use: `requested`, or the id with most frames for -1. Throws UsageError when it does not exist.
int ChoosePerson(const dataset::PanopticDataset& data, int requested);

/// Joints and intrinsics of row i, seen by a crop's camera.
void FillPose(AvatarPack& pack, int64_t i, const FullPose& pose, const geometry::RigCamera& crop);
void FillPose(AvatarPack& pack, int64_t i, const dataset::Coco19Pose& pose, const geometry::RigCamera& crop);  ///< BodyAlone

/// What a row of a pack shows: the crop's camera, and the body as the options pose it.
struct RowView {
  geometry::RigCamera crop;
  std::shared_ptr<const Eigen::Matrix3Xf> vertices;  ///< (3, V) metres, world; one for all cameras of a frame
};

struct TrainingSet {
  AvatarPack pack;
  std::vector<RowView> views;  ///< of each row, with keep_views
  int person = -1;
  double half_extent_m = 0;  ///< metres from the middle of a crop to its edge, at the person's distance
  BodyShape shape;           ///< girth used for part and uv
  double template_iou = 0;   ///< mean IoU of the posed template and the masks over all images; NaN without template maps
  std::vector<std::string> skipped;  ///< "camera 00_03, frame 17: reason", unusable images
  dataset::MissingImages missing;    ///< images and masks that the dataset does not hold; not in `skipped`
};

/// One crop per camera and frame. The crop's camera is a pinhole at the position of the real one, with the smallest
/// rotation that makes it look at the middle of the person's joints. Its focal length puts `half_extent_m` metres at the
/// person's distance to the edge, so a metre has the same size in every crop.
///
/// Colours are averages over each pixel's footprint in the real image, read through its exact lens; outside the image is
/// black and not person. Part and uv maps, and template_maps, come from the body template posed by the joints. An image or
/// mask that is not there is left out (`missing`). Throws FormatError naming camera and frame when one is damaged or of
/// another size, and when nothing is left; UsageError for cameras or frames that do not exist.
/// With `fitted`, maps for the network and body_images are posed as `pose_by` says; part and uv by images, where such poses
/// are.
TrainingSet BuildTrainingSet(const dataset::PanopticDataset& data, const TrainingSetOptions& options, const RunContext& run);

}  // namespace mvstudio::avatar
