#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/masks/masks.h"
#include "dataset/pose/pose2d.h"
#include "geometry/skeleton/skeleton.h"

/// Masks of one camera over a whole take: selects frames to learn from, learns, segments every frame.
namespace mvstudio::dataset {

class FrameSource;

/// People of one image from 2D keypoints. The size of a limb in pixels follows from the longest limbs, assumed to be an
/// adult's.
ProjectedBody BodyFromKeypoints(const std::vector<Person2d>& people, const geometry::Skeleton& skeleton,
                                const MaskOptions& options = {});

/// A net's probability of a person, (H, W, 1) 0..255; `body` may be null. Empty function: no net.
using PersonNet = std::function<Image(const Image& rgb, const ProjectedBody* body)>;

/// Positions of the people in a frame; null where unknown.
struct BodiesOfTake {
  std::map<int, ProjectedBody> frames;
  bool empty() const { return frames.empty(); }
  const ProjectedBody* At(int frame) const;
};

/// Images spread evenly over the footage.
struct FootageSamples {
  std::vector<int> numbers;   ///< frame numbers
  std::vector<int> all = {};  ///< of the footage
  std::vector<Image> frames;
  int num_frames = 0;  ///< of the footage
  int width = 0, height = 0;
  std::vector<std::string> damage = {};  ///< what does not decode, a line each
};
/// Decodes all of it. With `keep_undamaged` frames that do not decode are left out and listed, here and below. Throws
/// FormatError for images of different sizes, numbers out of order, or no image at all.
FootageSamples SampleFootage(const std::string& path, int count, bool keep_undamaged = false);

struct LearnedCamera {
  Status status = Status::kOk;  ///< kDegenerate: neither joints, nor a net, nor motion separate people from background
  CameraMaskModel model;
};
/// With joints as LearnCamera; else from a net's probabilities; else from motion. `plate` may be null.
LearnedCamera LearnTakeCamera(const FootageSamples& samples, const BodiesOfTake& bodies, const PersonNet& net,
                              const Image* plate, const MaskOptions& options);

/// How often pixels change class between frames although the image does not change there (grey levels, 3x3).
struct Flicker {
  double unmoving_px = 0, changed_px = 0;
  double Share() const { return unmoving_px > 0 ? changed_px / unmoving_px : 0; }
  void Add(const Image& rgb_before, const Image& mask_before, const Image& rgb, const Image& mask);
};

struct TakeMasks {
  int images = 0, empty = 0;
  double area_fraction_sum = 0;  ///< of all images
  int joints = 0, joints_on_mask = 0, joints_supported = 0;
  Flicker flicker;
  double seconds = 0;  ///< of segmentation alone

  double mean_area_fraction() const { return area_fraction_sum / std::max(1, images); }
  double ms_per_image() const { return 1000 * seconds / std::max(1, images); }
  void Add(const TakeMasks& more);
};

/// What is the same for all frames of a camera.
struct SegmentTools {
  const BodiesOfTake* bodies = nullptr;
  PersonNet net;
  const CameraMaskModel* model = nullptr;
  std::function<Image(int)> possible;  ///< of a frame: where other cameras allow a person; empty image: anywhere; may be empty
  const MaskOptions* options = nullptr;
  const std::set<int>* only = nullptr;  ///< frames that get a mask; null: all
};

/// Masks of one camera, block after block.
class TakeSegmenter {
 public:
  TakeSegmenter(const std::string& path, const SegmentTools& tools, bool keep_undamaged);
  ~TakeSegmenter();

  /// `use` receives number, image and mask of every frame whose position lies in [first, end), in order; frames before are
  /// passed over. The first mask knows nothing of the frame before. Returns how many frames of the footage there were: less
  /// than end - first at its end alone.
  int64_t Segment(int64_t first, int64_t end, const std::function<void(int, const Image&, const BodyMask&)>& use,
                  TakeMasks* take);

 private:
  SegmentTools tools_;
  std::unique_ptr<FrameSource> source_;
  int64_t position_ = 0;  ///< of the next frame
};

}  // namespace mvstudio::dataset
