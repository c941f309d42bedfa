#include "avatar/run/evaluate/evaluate_groups.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cstdio>
#include <sstream>

#include "avatar/run/pack/frame_runs.h"
#include "core/error.h"
#include "core/statistics.h"

namespace mvstudio::avatar {
namespace {

constexpr double kMostDb = 100;  // for intervals: equal images have no finite PSNR

int64_t CameraOf(const AvatarPack& pack, int64_t row) { return pack.camera_idx.data_ptr<int64_t>()[row]; }
int64_t FrameOf(const AvatarPack& pack, int64_t row) { return pack.frame.data_ptr<int64_t>()[row]; }

std::string RangeText(int first, int last) {
  return first == last ? std::to_string(first) : std::to_string(first) + "-" + std::to_string(last);
}

std::vector<MotionFrames> ConsecutiveRuns(std::vector<int> frames, const std::vector<int>& cuts) {
  std::sort(frames.begin(), frames.end());
  const int usual = UsualStep(frames);
  std::vector<MotionFrames> motions;
  for (const int frame : frames) {
    const auto clips = [&](int f) { return std::upper_bound(cuts.begin(), cuts.end(), f); };
    const bool follows = !motions.empty() && frame - motions.back().last <= usual && clips(frame) == clips(motions.back().last);
    if (!follows) motions.push_back({"", frame, frame});
    motions.back().last = frame;
  }
  for (MotionFrames& motion : motions) motion.name = RangeText(motion.first, motion.last);
  return motions;
}

MotionFrames ParseMotion(const std::string& text) {
  const size_t equals = text.find('=');
  const std::string range = equals == std::string::npos ? text : text.substr(equals + 1);
  MotionFrames motion;
  int length = 0;
  if (std::sscanf(range.c_str(), "%d-%d%n", &motion.first, &motion.last, &length) != 2 ||
      length != static_cast<int>(range.size()) || motion.last < motion.first || equals == 0) {
    throw UsageError("option 'motions': '" + text + "' is not NAME=FIRST-LAST");
  }
  motion.name = equals == std::string::npos ? RangeText(motion.first, motion.last) : text.substr(0, equals);
  return motion;
}

GroupScore ScoreOf(const std::string& name, const std::vector<int64_t>& rows, const AvatarPack& pack, const RowScores& scores,
                   uint64_t seed) {
  std::vector<metrics::ImageScore> own;
  std::vector<double> lpips, flicker, ssim;
  std::vector<int64_t> frames;
  for (const int64_t row : rows) {
    own.push_back(scores.images[row]);
    if (!scores.lpips.empty()) lpips.push_back(scores.lpips[row]);
    flicker.push_back(scores.flicker[row]);
    ssim.push_back(own.back().bbox.ssim);
    frames.push_back(FrameOf(pack, row));
  }
  return {name, metrics::Mean(own), FiniteMean(lpips), FiniteMean(flicker), metrics::BlockBootstrap(ssim, frames, seed)};
}

}  // namespace

std::vector<MotionFrames> ParseMotions(const std::string& text, const std::vector<int>& frames, const std::vector<int>& cuts) {
  if (text.empty()) return ConsecutiveRuns(frames, cuts);
  std::vector<MotionFrames> motions;
  std::istringstream in(text);
  for (std::string one; std::getline(in, one, ',');) {
    motions.push_back(ParseMotion(one));
    const MotionFrames& motion = motions.back();
    if (std::none_of(frames.begin(), frames.end(), [&](int f) { return motion.first <= f && f <= motion.last; }))
      throw UsageError("option 'motions': no frame of '" + one + "' is scored; the frames are " +
                       RangeText(frames.front(), frames.back()));
  }
  return motions;
}

double FiniteMean(const std::vector<double>& values) { return Mean(FiniteValues(values)); }

std::vector<GroupScore> PerCamera(const AvatarPack& pack, const RowScores& scores, uint64_t seed) {
  std::vector<GroupScore> groups;
  for (size_t c = 0; c < pack.cameras.size(); ++c) {
    std::vector<int64_t> rows;
    for (int64_t i = 0; i < pack.size(); ++i) {
      if (CameraOf(pack, i) == static_cast<int64_t>(c)) rows.push_back(i);
    }
    if (!rows.empty()) groups.push_back(ScoreOf(pack.cameras[c], rows, pack, scores, seed));
  }
  return groups;
}

std::vector<GroupScore> PerMotion(const AvatarPack& pack, const RowScores& scores, const std::vector<MotionFrames>& motions,
                                  uint64_t seed) {
  std::vector<GroupScore> groups;
  for (const MotionFrames& motion : motions) {
    std::vector<int64_t> rows;
    for (int64_t i = 0; i < pack.size(); ++i) {
      if (motion.first <= FrameOf(pack, i) && FrameOf(pack, i) <= motion.last) rows.push_back(i);
    }
    if (!rows.empty()) groups.push_back(ScoreOf(motion.name, rows, pack, scores, seed));
  }
  return groups;
}

std::map<std::string, metrics::Interval> Intervals(const AvatarPack& pack, const RowScores& scores, uint64_t seed) {
  std::map<std::string, std::vector<double>> values;
  std::vector<int64_t> frames;
  for (int64_t i = 0; i < pack.size(); ++i) {
    const metrics::ImageScore& score = scores.images[i];
    const std::pair<const char*, const metrics::RegionScore*> regions[] = {
        {"", &score.bbox}, {"full.", &score.full}, {"masked.", &score.masked}};
    for (const auto& [prefix, region] : regions) {
      values[prefix + std::string("ssim")].push_back(region->ssim);
      values[prefix + std::string("psnr_db")].push_back(std::min(region->psnr_db, kMostDb));
    }
    values["mask_iou"].push_back(score.mask_iou);
    values["boundary_f"].push_back(score.boundary_f);
    frames.push_back(FrameOf(pack, i));
  }
  if (!scores.lpips.empty()) values["lpips"] = scores.lpips;
  std::map<std::string, metrics::Interval> intervals;
  for (const auto& [key, list] : values) intervals[key] = metrics::BlockBootstrap(list, frames, seed);
  return intervals;
}

std::vector<int64_t> Examples(const AvatarPack& pack, int count) {
  std::vector<int64_t> chosen;
  for (size_t c = 0; c < pack.cameras.size(); ++c) {
    std::vector<int64_t> own;
    for (int64_t i = 0; i < pack.size(); ++i) {
      if (CameraOf(pack, i) == static_cast<int64_t>(c)) own.push_back(i);
    }
    const size_t number = count < 0 ? own.size() : std::min(own.size(), static_cast<size_t>(count));
    for (size_t k = 0; k < number; ++k) chosen.push_back(own[(2 * k + 1) * own.size() / (2 * number)]);
  }
  return chosen;
}

}  // namespace mvstudio::avatar
