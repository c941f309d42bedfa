#include <algorithm>
#include <array>
#include <cmath>

#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/posenet.h"

namespace mvstudio::detect {

using dataset::Keypoint2d;
using dataset::Person2d;
using internal::kPosenetStride;
using internal::PosenetOutputs;

namespace {

constexpr int kJoints = 17;
constexpr int kImagePx = 385;         // side of what the net is given
constexpr double kSeedScore = 0.35;   // of a joint that a person may grow from
constexpr double kPersonScore = 0.2;  // mean of the joints
constexpr double kSureScore = 0.5;    // mean of the joints above which a person is no less one than any other
constexpr double kSeedRadiusPx = 20;  // in the net's pixels

/// PoseNet's tree of joints, in the order of its displacements: parent, child (COCO's numbers).
constexpr std::array<std::pair<int, int>, 16> kTree = {{{0, 1},
                                                        {1, 3},
                                                        {0, 2},
                                                        {2, 4},
                                                        {0, 5},
                                                        {5, 7},
                                                        {7, 9},
                                                        {5, 11},
                                                        {11, 13},
                                                        {13, 15},
                                                        {0, 6},
                                                        {6, 8},
                                                        {8, 10},
                                                        {6, 12},
                                                        {12, 14},
                                                        {14, 16}}};

/// COCO's standard deviations of annotated joints, as a share of the person's size.
constexpr std::array<double, kJoints> kCocoSigma = {.026, .025, .025, .035, .035, .079, .079, .072, .072,
                                                    .062, .062, .107, .107, .087, .087, .089, .089};

struct Field {
  const PosenetOutputs& out;
  int height = 0, width = 0;

  explicit Field(const PosenetOutputs& o)
      : out(o), height(static_cast<int>(o.heat.shape[1])), width(static_cast<int>(o.heat.shape[2])) {}
  size_t Cell(double x_px, double y_px) const {
    const int x = std::clamp(static_cast<int>(std::lround(x_px / kPosenetStride)), 0, width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(y_px / kPosenetStride)), 0, height - 1);
    return static_cast<size_t>(y) * width + x;
  }
  double Score(size_t cell, int joint) const { return out.heat.values[cell * kJoints + joint]; }
  Keypoint2d Joint(size_t cell, int joint) const {
    const auto x = static_cast<int>(cell % width), y = static_cast<int>(cell / width);
    return {x * kPosenetStride + static_cast<double>(out.offset.values[cell * 34 + 17 + joint]),
            y * kPosenetStride + static_cast<double>(out.offset.values[cell * 34 + joint]), Score(cell, joint)};
  }
  /// The joint at the other end of an edge.
  Keypoint2d Follow(const Keypoint2d& from, const FloatTensor& displacement, size_t edge, int joint) const {
    const size_t cell = Cell(from.x_px, from.y_px);
    double x = from.x_px + displacement.values[cell * 32 + 16 + edge], y = from.y_px + displacement.values[cell * 32 + edge];
    Keypoint2d found;
    for (int step = 0; step < 2; ++step) {  // the offset of where we came out leads closer
      found = Joint(Cell(x, y), joint);
      x = found.x_px, y = found.y_px;
    }
    return found;
  }
};

struct Seed {
  double score = 0;
  int joint = 0;
  size_t cell = 0;
};

std::vector<Seed> FindSeeds(const Field& field) {
  std::vector<Seed> seeds;
  for (int j = 0; j < kJoints; ++j) {
    for (int y = 0; y < field.height; ++y) {
      for (int x = 0; x < field.width; ++x) {
        const size_t cell = static_cast<size_t>(y) * field.width + x;
        const double score = field.Score(cell, j);
        bool peak = score >= kSeedScore;
        for (int v = std::max(0, y - 1); peak && v <= std::min(field.height - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); peak && u <= std::min(field.width - 1, x + 1); ++u) {
            peak = field.Score(static_cast<size_t>(v) * field.width + u, j) <= score;
          }
        }
        if (peak) seeds.push_back({score, j, cell});
      }
    }
  }
  std::stable_sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) { return a.score > b.score; });
  return seeds;
}

Person2d Grow(const Field& field, const Seed& seed) {
  Person2d person{std::vector<Keypoint2d>(kJoints)};
  std::array<bool, kJoints> done{};
  person.keypoints[seed.joint] = field.Joint(seed.cell, seed.joint);
  done[seed.joint] = true;
  for (size_t e = kTree.size(); e-- > 0;) {
    const auto [parent, child] = kTree[e];
    if (!done[child] || done[parent]) continue;
    person.keypoints[parent] = field.Follow(person.keypoints[child], field.out.backward, e, parent);
    done[parent] = true;
  }
  for (size_t e = 0; e < kTree.size(); ++e) {
    const auto [parent, child] = kTree[e];
    if (!done[parent] || done[child]) continue;
    person.keypoints[child] = field.Follow(person.keypoints[parent], field.out.forward, e, child);
    done[child] = true;
  }
  return person;
}

/// Mean score of the joints that are not on a person found before.
double FreshScore(const Person2d& person, const std::vector<CoarsePerson>& found) {
  double sum = 0;
  for (size_t j = 0; j < kJoints; ++j) {
    const Keypoint2d& a = person.keypoints[j];
    const bool taken = std::any_of(found.begin(), found.end(), [&](const CoarsePerson& other) {
      const Keypoint2d& b = other.pose.keypoints[j];
      return std::hypot(a.x_px - b.x_px, a.y_px - b.y_px) < kSeedRadiusPx;
    });
    if (!taken) sum += a.score;
  }
  return sum / kJoints;
}

}  // namespace

std::vector<CoarsePerson> internal::DecodePeople(const PosenetOutputs& outputs) {
  const Field field(outputs);
  std::vector<CoarsePerson> found;
  for (const Seed& seed : FindSeeds(field)) {
    const Keypoint2d at = field.Joint(seed.cell, seed.joint);
    const bool taken = std::any_of(found.begin(), found.end(), [&](const CoarsePerson& other) {
      const Keypoint2d& b = other.pose.keypoints[static_cast<size_t>(seed.joint)];
      return std::hypot(at.x_px - b.x_px, at.y_px - b.y_px) < kSeedRadiusPx;
    });
    if (taken) continue;
    const Person2d person = Grow(field, seed);
    const double score = FreshScore(person, found);
    if (score >= kPersonScore) found.push_back({person, score});
  }
  return found;
}

namespace {

double AreaOf(const Person2d& person, double min_score) {
  double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
  for (const Keypoint2d& joint : person.keypoints) {
    if (joint.score < min_score) continue;
    x0 = std::min(x0, joint.x_px), x1 = std::max(x1, joint.x_px), y0 = std::min(y0, joint.y_px), y1 = std::max(y1, joint.y_px);
  }
  return x1 > x0 ? std::max((x1 - x0) * (y1 - y0), 0.04 * std::pow(std::max(x1 - x0, y1 - y0), 2)) : 0;
}

/// Middles of tiles that cover 0..length and overlap by two thirds.
std::vector<double> TileMiddles(double length, double tile) {
  if (length <= tile) return {0.5 * length - 0.5};
  const int count = static_cast<int>(std::ceil((length - tile) / (tile / 3))) + 1;
  std::vector<double> middles;
  for (int i = 0; i < count; ++i) middles.push_back(0.5 * tile + i * (length - tile) / (count - 1) - 0.5);
  return middles;
}

std::vector<Crop> Tiles(const Image& rgb, int levels) {
  std::vector<Crop> tiles;
  for (int level = 0; level < levels; ++level) {
    const double tile = std::max(rgb.width, rgb.height) * std::pow(0.7, level);
    for (const double y : TileMiddles(rgb.height, tile)) {
      for (const double x : TileMiddles(rgb.width, tile)) tiles.push_back({x, y, tile});
    }
  }
  return tiles;
}

}  // namespace

double PoseSimilarity(const Person2d& a, const Person2d& b, double min_score) {
  const double area = 0.5 * (AreaOf(a, min_score) + AreaOf(b, min_score));
  if (!(area > 0)) return 0;
  double sum = 0;
  int count = 0;
  for (size_t j = 0; j < std::min(a.keypoints.size(), b.keypoints.size()); ++j) {
    const Keypoint2d &p = a.keypoints[j], &q = b.keypoints[j];
    if (p.score < min_score || q.score < min_score) continue;
    const double sigma = 2 * (j < kCocoSigma.size() && a.keypoints.size() == kCocoSigma.size() ? kCocoSigma[j] : 0.08);
    const double off2 = std::pow(p.x_px - q.x_px, 2) + std::pow(p.y_px - q.y_px, 2);
    sum += std::exp(-off2 / (2 * area * sigma * sigma));
    ++count;
  }
  return count ? sum / count : 0;
}

struct PersonFinder::Impl {
  internal::PosenetGraph graph;
};

PersonFinder::PersonFinder(const std::string& models_folder) : impl_(new Impl{internal::PosenetGraph(models_folder)}) {}
PersonFinder::~PersonFinder() = default;

std::vector<CoarsePerson> PersonFinder::Find(const Image& rgb, int max_persons, int levels) const {
  std::vector<CoarsePerson> all;
  for (const Crop& tile : Tiles(rgb, levels)) {
    for (CoarsePerson& person : internal::DecodePeople(impl_->graph.Run(CutCrop(rgb, tile, kImagePx)))) {
      for (Keypoint2d& joint : person.pose.keypoints) joint = FromCrop(joint, tile, kImagePx);
      all.push_back(std::move(person));
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const CoarsePerson& a, const CoarsePerson& b) { return a.score > b.score; });
  std::vector<CoarsePerson> kept;
  for (CoarsePerson& person : all) {
    const bool twice = std::any_of(kept.begin(), kept.end(),
                                   [&](const CoarsePerson& k) { return PoseSimilarity(person.pose, k.pose, 0.1) > 0.2; });
    if (!twice) kept.push_back(std::move(person));
  }
  const auto weight = [](const CoarsePerson& p) { return std::min(p.score, kSureScore) * CropAround(p.pose, 1, 0.1).size_px; };
  std::stable_sort(kept.begin(), kept.end(),
                   [&](const CoarsePerson& a, const CoarsePerson& b) { return weight(a) > weight(b); });
  if (kept.size() > static_cast<size_t>(max_persons)) kept.resize(static_cast<size_t>(max_persons));
  return kept;
}

}  // namespace mvstudio::detect
