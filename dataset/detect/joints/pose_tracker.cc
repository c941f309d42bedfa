#include "dataset/detect/joints/pose_tracker.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace mvstudio::detect {

using dataset::Keypoint2d;
using dataset::Person2d;

namespace {

constexpr ChoiceWords<PoseQuality, 3> kQualities = {
    {{PoseQuality::kFast, "fast"}, {PoseQuality::kBalanced, "balanced"}, {PoseQuality::kExact, "exact"}}};

constexpr double kSeenScore = 0.1;      // joints that count for boxes and likeness
constexpr double kLeanScore = 0.3;      // joints of the trunk that tell how to turn a crop
constexpr double kSameLikeness = 0.35;  // of two poses of one person in one image
constexpr double kDoubt = 0.85;         // of the usual score, below which other crops are looked at
constexpr double kOust = 1.25;          // presence of somebody new, against somebody followed, to take their place
constexpr double kForget = 0.99;        // how the usual score falls, a frame

/// How much a person is the one that the camera films.
double Presence(const Person2d& pose, double score) {
  constexpr double kSureScore = 0.5;
  return std::min(score, kSureScore) * CropAround(pose, 1, kSeenScore).size_px;
}

double MeanScore(const Person2d& person) {
  double sum = 0;
  for (const Keypoint2d& joint : person.keypoints) sum += joint.score;
  return person.keypoints.empty() ? 0 : sum / static_cast<double>(person.keypoints.size());
}

/// Positions of one joint from several crops: their mean around the best one, weighted by score.
Keypoint2d Combine(const std::vector<Keypoint2d>& found, double reach_px) {
  const Keypoint2d best =
      *std::max_element(found.begin(), found.end(), [](const Keypoint2d& a, const Keypoint2d& b) { return a.score < b.score; });
  Keypoint2d mean;
  double sum = 0, score = 0;
  for (const Keypoint2d& joint : found) {
    score += joint.score / static_cast<double>(found.size());
    if (std::hypot(joint.x_px - best.x_px, joint.y_px - best.y_px) > reach_px) continue;
    sum += joint.score, mean.x_px += joint.score * joint.x_px, mean.y_px += joint.score * joint.y_px;
  }
  if (!(sum > 0)) return best;
  return {mean.x_px / sum, mean.y_px / sum, score};
}

std::vector<Keypoint2d> Mirrored(const std::vector<Keypoint2d>& joints, const std::vector<std::pair<int, int>>& mirror,
                                 int size) {
  std::vector<Keypoint2d> mirrored = joints;
  for (Keypoint2d& joint : mirrored) joint.x_px = size - 1 - joint.x_px;
  for (const auto& [left, right] : mirror) std::swap(mirrored[static_cast<size_t>(left)], mirrored[static_cast<size_t>(right)]);
  return mirrored;
}

std::vector<Keypoint2d> LocateOnce(const JointNet& net, const Image& rgb, const Crop& crop, bool mirror,
                                   const Person2d& expected) {
  const int size = net.input_px();
  std::vector<Keypoint2d> likely;
  if (expected.keypoints.size() == net.skeleton().joints.size()) {
    for (const Keypoint2d& joint : expected.keypoints) likely.push_back(ToCrop(joint, crop, size));
  }
  const Image image = CutCrop(rgb, crop, size);
  JointMaps maps = net.Run(image, likely);
  if (mirror) {
    const std::vector<std::pair<int, int>> pairs = geometry::MirrorJoints(net.skeleton());
    if (!likely.empty()) likely = Mirrored(likely, pairs, size);
    maps = AverageMirrored(maps, net.Run(MirrorImage(image), likely), pairs, size);
  }
  std::vector<Keypoint2d> joints = ReadJoints(maps);
  for (Keypoint2d& joint : joints) joint = FromCrop(joint, crop, size);
  return joints;
}

/// The crop requested by a person's last pose, kept near the previous crop: a wrong pose must not move the crop, since the
/// next frame would be worse.
Crop Steady(const Crop& wanted, const Crop& before) {
  if (!(before.size_px > 0) || !(wanted.size_px > 0)) return wanted.size_px > 0 ? wanted : before;
  constexpr double kShrink = 0.98, kGrow = 1.25, kMove = 0.12, kTurnRad = 0.3;  // a frame
  Crop crop = wanted;
  crop.size_px = std::clamp(wanted.size_px, kShrink * before.size_px, kGrow * before.size_px);
  const double dx = wanted.x_px - before.x_px, dy = wanted.y_px - before.y_px;
  const double share = std::min(1.0, kMove * before.size_px / std::max(1e-9, std::hypot(dx, dy)));
  crop.x_px = before.x_px + share * dx, crop.y_px = before.y_px + share * dy;
  const double turn = std::remainder(wanted.angle_rad - before.angle_rad, 2 * M_PI);
  crop.angle_rad = before.angle_rad + std::clamp(turn, -kTurnRad, kTurnRad);
  return crop;
}

}  // namespace

std::string_view ToString(PoseQuality quality) { return WordOf(kQualities, quality); }

void FromString(const std::string& text, PoseQuality* quality) {
  *quality = KnownChoice(kQualities, text, "option 'quality' " + text + ": must be fast, balanced or exact");
}

CropPlan PlanOf(PoseQuality quality) {
  if (quality == PoseQuality::kFast) return {{1.0}, false, 1, 257};
  if (quality == PoseQuality::kBalanced) return {{1.0}, true, 2, 353};
  return {{1.0, 0.85, 1.2}, true, 2, 449};
}

Person2d LocateJoints(const JointNet& net, const Image& rgb, const Crop& crop, const CropPlan& plan, const Person2d& expected) {
  std::vector<std::vector<Keypoint2d>> runs;
  for (const double scale : plan.scales)
    runs.push_back(LocateOnce(net, rgb, {crop.x_px, crop.y_px, crop.size_px * scale, crop.angle_rad}, plan.mirror, expected));
  Person2d person;
  for (size_t j = 0; j < runs[0].size(); ++j) {
    std::vector<Keypoint2d> found;
    for (const auto& run : runs) found.push_back(run[j]);
    const Keypoint2d joint = Combine(found, 0.05 * crop.size_px);
    const bool inside =
        joint.x_px >= -0.5 && joint.y_px >= -0.5 && joint.x_px < rgb.width - 0.5 && joint.y_px < rgb.height - 0.5;
    person.keypoints.push_back(inside ? joint : Keypoint2d());  // nothing was seen where no image is
  }
  return person;
}

PoseTracker::PoseTracker(const JointNet& net, const PersonFinder* finder, const PoseOptions& options, const CropPlan& plan)
    : net_(net), finder_(finder), options_(options), plan_(plan) {
  if (options.max_persons < 1 || options.redetect_frames < 1)
    throw UsageError("option 'max-persons' and option 'redetect-frames' must be at least 1");
}

TrackedPerson PoseTracker::Locate(const Image& rgb, const Crop& crop, const Person2d& expected) const {
  TrackedPerson person;
  person.crop = crop;
  person.pose = LocateJoints(net_, rgb, crop, plan_, expected);
  person.score = person.usual_score = MeanScore(person.pose);
  return person;
}

TrackedPerson PoseTracker::Examine(const Image& rgb, const Person2d& rough, int passes) const {
  TrackedPerson person{-1, rough, MeanScore(rough), {}, 0};
  for (int pass = 0; pass < passes; ++pass) {
    const Crop crop = CropAround(person.pose, net_.person_fill(), kSeenScore, LeanOf(person.pose, net_.skeleton(), kLeanScore));
    if (!(crop.size_px > 0)) break;
    person = Locate(rgb, crop, person.pose);
  }
  return person;
}

/// Crops turned otherwise: nets know people best who stand upright in the crop, and which way is up is a guess.
TrackedPerson PoseTracker::LookAgain(const Image& rgb, const TrackedPerson& before, const TrackedPerson& now) const {
  const auto trust = [&](const TrackedPerson& p) { return p.score * (0.5 + PoseSimilarity(before.pose, p.pose, kSeenScore)); };
  TrackedPerson best = now;
  for (const double turn : {-0.7, -0.35, 0.35, 0.7}) {
    Crop crop = now.crop;
    crop.angle_rad += turn;
    TrackedPerson other = Locate(rgb, crop, before.pose);
    if (trust(other) > trust(best)) best = std::move(other);
  }
  return best;
}

void PoseTracker::Follow(const Image& rgb) {
  std::vector<TrackedPerson> kept;
  for (const TrackedPerson& before : people_) {
    const Crop wanted =
        CropAround(before.pose, net_.person_fill(), kSeenScore, LeanOf(before.pose, net_.skeleton(), kLeanScore));
    TrackedPerson now = Locate(rgb, Steady(wanted, before.crop), before.pose);
    const bool doubtful =
        now.score < kDoubt * before.usual_score || PoseSimilarity(before.pose, now.pose, kSeenScore) < kSameLikeness;
    if (doubtful) now = LookAgain(rgb, before, now);
    now.id = before.id;
    now.usual_score = std::max(now.score, kForget * before.usual_score);
    const bool twice = std::any_of(kept.begin(), kept.end(), [&](const TrackedPerson& k) {
      return PoseSimilarity(k.pose, now.pose, kSeenScore) > kSameLikeness;
    });
    if (now.score >= options_.min_person_score && !twice) {
      kept.push_back(std::move(now));
    } else {
      lost_.push_back(before);
    }
  }
  people_ = std::move(kept);
}

void PoseTracker::Search(const Image& rgb) {
  std::vector<CoarsePerson> found;
  if (finder_) found = finder_->Find(rgb, options_.max_persons, 2);
  for (CoarsePerson& coarse : found) coarse.pose = OnSkeleton(coarse.pose, geometry::SkeletonByName("coco17"), net_.skeleton());
  if (!finder_ && people_.empty()) {
    Person2d frame{{{0, 0, 1}, {rgb.width - 1.0, rgb.height - 1.0, 1}}};
    found.push_back({frame, 1});
  }
  for (const CoarsePerson& coarse : found) {
    const bool full = static_cast<int>(people_.size()) >= options_.max_persons;
    const auto least = std::min_element(people_.begin(), people_.end(), [](const TrackedPerson& a, const TrackedPerson& b) {
      return Presence(a.pose, a.score) < Presence(b.pose, b.score);
    });
    if (full && Presence(coarse.pose, coarse.score) < kOust * Presence(least->pose, least->score)) continue;
    const auto same = [&](const Person2d& pose) {
      return [&](const TrackedPerson& k) { return PoseSimilarity(k.pose, pose, kSeenScore) > kSameLikeness; };
    };
    if (std::any_of(people_.begin(), people_.end(), same(coarse.pose))) continue;
    TrackedPerson person = Examine(rgb, coarse.pose, plan_.passes + 1);
    if (person.score < options_.min_person_score || std::any_of(people_.begin(), people_.end(), same(person.pose))) continue;
    if (full) lost_.push_back(*least), people_.erase(least);
    const auto back = std::find_if(lost_.begin(), lost_.end(), same(person.pose));
    person.id = back != lost_.end() ? back->id : next_id_++;
    if (back != lost_.end()) lost_.erase(back);
    people_.push_back(std::move(person));
  }
}

std::vector<TrackedPerson> PoseTracker::Next(const Image& rgb) {
  Follow(rgb);
  const bool missing = static_cast<int>(people_.size()) < options_.max_persons;
  const bool nobody = people_.empty();
  if (nobody || frames_ % options_.redetect_frames == 0 || (missing && options_.max_persons == 1)) Search(rgb);
  ++frames_;
  std::sort(people_.begin(), people_.end(), [](const TrackedPerson& a, const TrackedPerson& b) { return a.id < b.id; });
  std::vector<TrackedPerson> visible = people_;
  for (TrackedPerson& person : visible) {
    for (Keypoint2d& joint : person.pose.keypoints) {
      if (joint.score < options_.min_joint_score) joint = {};
    }
  }
  return visible;
}

}  // namespace mvstudio::detect
