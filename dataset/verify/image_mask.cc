#include "dataset/verify/image_mask.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/exchanged.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset {
namespace {

constexpr int kFrames = 8;          // of a camera that are looked at
constexpr int kMostShift = 8;       // frames
constexpr int kLongerSidePx = 512;  // to which images and masks are reduced
constexpr double kMostEdge = 4;     // of the mean: one strong edge counts no more than that

/// Points along a mask's border, with the direction across it.
struct Outline {
  struct Point {
    int x, y;
    float across_x, across_y;  // unit vector
  };
  int width = 0, height = 0;  // of the mask as it is stored
  std::vector<Point> points;
};

/// Gradient of an image.
struct Edges {
  int width = 0, height = 0;  // of the image as it is stored
  cv::Mat dx, dy;             // CV_32F
  double mean = 0;            // length
};

void Gradient(const Image& image, cv::Mat* dx, cv::Mat* dy) {
  const Image small = Reduced(image, kLongerSidePx);
  const cv::Mat view(small.height, small.width, CV_8UC1, const_cast<uint8_t*>(small.pixels.data()));
  cv::Mat smooth;
  view.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, cv::Size(0, 0), 1.0);
  cv::Sobel(smooth, *dx, CV_32F, 1, 0), cv::Sobel(smooth, *dy, CV_32F, 0, 1);
}

/// The image's border is no outline: a person who is cut off there has no edge.
Outline OutlineOf(const Image& mask) {
  Outline outline{mask.width, mask.height, {}};
  cv::Mat dx, dy;
  Gradient(mask, &dx, &dy);
  const Image small = Reduced(mask, kLongerSidePx);
  const auto inside = [&](int x, int y) { return *small.Pixel(x, y) > 127; };
  for (int y = 1; y + 1 < small.height; ++y) {
    for (int x = 1; x + 1 < small.width; ++x) {
      if (!inside(x, y) || (inside(x - 1, y) && inside(x + 1, y) && inside(x, y - 1) && inside(x, y + 1))) continue;
      const float gx = dx.at<float>(y, x), gy = dy.at<float>(y, x), length = std::hypot(gx, gy);
      if (length > 0) outline.points.push_back({x, y, gx / length, gy / length});
    }
  }
  return outline;
}

Edges EdgesOf(const Image& image) {
  Edges edges{image.width, image.height, {}, {}, 0};
  Gradient(image, &edges.dx, &edges.dy);
  cv::Mat length;
  cv::magnitude(edges.dx, edges.dy, length);
  edges.mean = cv::mean(length)[0];
  return edges;
}

/// Mean strength of the image's edges along an outline, as a multiple of its mean edge: 1 to expect anywhere. Nothing for an
/// outline of a few pixels, an image without contrast, or another size.
std::optional<double> Strength(const Edges& edges, const Outline& outline) {
  if (outline.points.size() < 50 || edges.mean < 0.2) return std::nullopt;
  if (outline.width != edges.width || outline.height != edges.height) return std::nullopt;
  double sum = 0;
  for (const Outline::Point& p : outline.points) {
    const float across = edges.dx.at<float>(p.y, p.x) * p.across_x + edges.dy.at<float>(p.y, p.x) * p.across_y;
    sum += std::min<double>(std::abs(across), kMostEdge * edges.mean);
  }
  return sum / edges.mean / static_cast<double>(outline.points.size());
}

/// Strengths along two outlines, in the same images.
struct Comparison {
  std::string camera;  // of the other masks; empty: the camera's own, of another frame
  int shift = 0;       // frame of the other mask less that of the image
  int frames = 0, better = 0;
  double own = 0, other = 0, log = 0, log_squared = 0;  // sums

  void Add(double own_strength, double other_strength) {
    const double ratio = std::log(std::max(other_strength, 0.05) / std::max(own_strength, 0.05));
    ++frames, better += ratio > 0;
    own += own_strength, other += other_strength, log += ratio, log_squared += ratio * ratio;
  }
  /// Clean recordings reach 1.01 times at most (people who hardly move), faulty ones begin at 1.3.
  bool IsClear() const {
    if (frames < 3 || better < 0.8 * frames || other < 1.5 * frames) return false;
    const double mean = log / frames, variance = std::max(0.0, log_squared / frames - mean * mean) * frames / (frames - 1);
    return mean >= std::log(1.25) && mean >= 4 * std::sqrt(std::max(variance, 4e-4) / frames);
  }
};

/// At most so many of all that some camera has, spread evenly.
std::vector<int> Chosen(const CameraFrames& frames, int most = kFrames) {
  std::set<int> all;
  for (const auto& [camera, of] : frames) all.insert(of.begin(), of.end());
  const std::vector<int> list(all.begin(), all.end());
  std::vector<int> chosen;
  const int n = std::min<int>(most, static_cast<int>(list.size()));
  for (int i = 0; i < n; ++i) chosen.push_back(list[n == 1 ? 0 : i * (list.size() - 1) / (n - 1)]);
  return chosen;
}

/// Difference of the numbers of consecutive frames.
int StepOf(const std::vector<int>& frames) {
  int step = 0;
  for (size_t i = 1; i < frames.size(); ++i)
    step = step == 0 ? frames[i] - frames[i - 1] : std::min(step, frames[i] - frames[i - 1]);
  return std::max(step, 1);
}

class ImageMaskCheck {
 public:
  ImageMaskCheck(const PanopticDataset& data, const MaskMeaning& masks, const CameraFrames& frames)
      : data_(data), masks_(masks), frames_(frames), chosen_(Chosen(frames)) {
    for (const auto& [camera, of] : frames) names_.push_back(camera);
  }

  std::vector<Finding> Run(const RunContext& run) {
    std::vector<std::vector<Finding>> found(names_.size());
    outlines_.resize(names_.size());
    ProgressStage stage(run, "images against masks", 1);
    const auto count = static_cast<int64_t>(names_.size());
    ParallelFor(count, run.num_threads, [&](int64_t c) {
      for (const int frame : chosen_)
        outlines_[static_cast<size_t>(c)].push_back(OutlineAt(names_[static_cast<size_t>(c)], frame));
    });
    ParallelFor(count, run.num_threads, [&](int64_t c) { found[static_cast<size_t>(c)] = Camera(static_cast<size_t>(c)); });
    std::vector<Finding> all;
    for (const auto& of : found) all.insert(all.end(), of.begin(), of.end());
    return all;
  }

 private:
  bool Has(const std::string& camera, int frame) const {
    const std::vector<int>& of = frames_.at(camera);
    return std::binary_search(of.begin(), of.end(), frame);
  }

  Outline OutlineAt(const std::string& camera, int frame) const {
    const std::string path = data_.MaskPath(camera, frame);
    if (!Has(camera, frame) || !std::filesystem::exists(path)) return {};
    try {
      return OutlineOf(dataset::ReadMask(path, masks_));
    } catch (const FormatError&) {
      return {};  // told as DAT-MASK
    }
  }

  Edges EdgesAt(const std::string& camera, int frame) const {
    const std::string path = data_.ImagePath(camera, frame);
    if (!std::filesystem::exists(path)) return {};
    try {
      return EdgesOf(ReadImage(path, true));
    } catch (const FormatError&) {
      return {};  // told as DAT-IMAGE
    }
  }

  std::vector<Finding> Camera(size_t c) const {
    std::vector<Comparison> comparisons;
    for (size_t o = 0; o < names_.size(); ++o) {
      if (o != c) comparisons.push_back({names_[o]});
    }
    const int step = StepOf(frames_.at(names_[c]));
    for (int s = -kMostShift; s <= kMostShift; ++s) {
      if (s != 0) comparisons.push_back({"", s * step});
    }
    for (size_t i = 0; i < chosen_.size(); ++i) {
      if (outlines_[c][i].points.empty()) continue;
      const Edges edges = EdgesAt(names_[c], chosen_[i]);
      const std::optional<double> own = Strength(edges, outlines_[c][i]);
      if (own) Compare(edges, *own, c, i, &comparisons);
    }
    const auto end = std::remove_if(comparisons.begin(), comparisons.end(), [](const Comparison& o) { return !o.IsClear(); });
    const auto best = std::max_element(comparisons.begin(), end, [](const Comparison& a, const Comparison& b) {
      return a.other / a.frames < b.other / b.frames;
    });
    if (best == end) return {};
    return {{Finding::Severity::kError, "DAT-IMAGE-MASK", data_.root + "/hdImgs/" + names_[c], Text(names_[c], *best)}};
  }

  void Compare(const Edges& edges, double own, size_t c, size_t i, std::vector<Comparison>* comparisons) const {
    size_t at = 0;
    for (size_t o = 0; o < names_.size(); ++o) {
      if (o == c) continue;
      Comparison& comparison = (*comparisons)[at++];
      if (const auto other = Strength(edges, outlines_[o][i])) comparison.Add(own, *other);
    }
    for (; at < comparisons->size(); ++at) {
      Comparison& comparison = (*comparisons)[at];
      if (const auto other = Strength(edges, OutlineAt(names_[c], chosen_[i] + comparison.shift))) comparison.Add(own, *other);
    }
  }

  static std::string Text(const std::string& camera, const Comparison& best) {
    const std::string figures = Format(
        "edges along their outlines are %.1f times as strong as along its own (%.2f against %.2f of "
        "the mean edge, %d frames)",
        best.other / std::max(best.own, 1e-3), best.other / best.frames, best.own / best.frames, best.frames);
    if (!best.camera.empty())
      return "its images fit the masks of " + best.camera + ", not those of " + camera + ": " + figures +
             ": were images of two cameras exchanged? Name the footage rightly and build again, or exchange the folders";
    const int by = std::abs(best.shift);
    return Format("its images fit the masks of %d frames %s: ", by, best.shift < 0 ? "earlier" : "later") + figures +
           Format(
               ": are the images %d frames %s, against masks and joints? Number the images again, or build with the camera's "
               "time offset",
               by, best.shift < 0 ? "late" : "early");
  }

  const PanopticDataset& data_;
  const MaskMeaning& masks_;
  const CameraFrames& frames_;
  const std::vector<int> chosen_;
  std::vector<std::string> names_;
  std::vector<std::vector<Outline>> outlines_;  // by camera, of the chosen frames
};

}  // namespace

std::vector<Finding> CompareImagesWithMasks(const PanopticDataset& data, const MaskMeaning& masks, const CameraFrames& frames,
                                            const RunContext& run) {
  return ImageMaskCheck(data, masks, frames).Run(run);
}

std::vector<Finding> CompareImagesWithJoints(const PanopticDataset& data, const CameraFrames& frames, const RunContext& run) {
  geometry::Rig rig;
  for (const geometry::RigCamera& camera : data.rig.cameras) {
    if (frames.count(camera.camera.name) > 0) rig.cameras.push_back(camera);
  }
  const std::vector<int> looked_at = Chosen(frames, 24);
  std::map<int, std::map<int, Coco19Pose>> poses;
  for (const int frame : looked_at) {
    const auto people = data.poses.find(frame);
    if (people != data.poses.end()) poses.insert(*people);
  }
  const auto image = [&](const std::string& camera, int frame) { return data.ImagePath(camera, frame); };
  std::vector<Finding> findings;
  for (const ExchangedCameras& found : FindExchanged(rig, poses, image, run)) {
    findings.push_back(
        {Finding::Severity::kError, "DAT-EXCHANGED", data.root + "/hdImgs/" + found.a,
         found.Text(found.a, found.b) + ": exchange the folders, or build again with the footage named rightly"});
  }
  return findings;
}

std::vector<Finding> CompareJointsWithMasks(const PanopticDataset& data, const MaskMeaning& masks, const CameraFrames& frames,
                                            const RunContext& run) {
  const std::vector<int> chosen = Chosen(frames);
  std::vector<internal::MaskCover> covers(frames.size());
  std::vector<std::string> names;
  for (const auto& [camera, of] : frames) names.push_back(camera);
  ParallelFor(static_cast<int64_t>(names.size()), run.num_threads, [&](int64_t c) {
    const std::string& name = names[static_cast<size_t>(c)];
    const int index = data.rig.Find(name);
    if (index < 0) return;
    const geometry::RigCamera& camera = data.rig.cameras[static_cast<size_t>(index)];
    const geometry::Projector projector(camera.camera);
    for (const int frame : chosen) {
      const auto people = data.poses.find(frame);
      const std::string path = data.MaskPath(name, frame);
      if (people == data.poses.end() || !std::filesystem::exists(path)) continue;
      try {
        const Image mask = dataset::ReadMask(path, masks);
        if (mask.width != camera.camera.width_px || mask.height != camera.camera.height_px) continue;
        covers[static_cast<size_t>(c)].Add(mask, internal::ProjectJoints(people->second, camera, projector));
      } catch (const FormatError&) {
        continue;  // the command that needs this mask refuses it
      }
    }
  });
  internal::Findings findings;
  for (size_t c = 0; c < names.size(); ++c)
    covers[c].Report(data.root + "/masks/" + names[c], VerifyOptions().least_cover, &findings);
  return findings.list();
}

}  // namespace mvstudio::dataset
