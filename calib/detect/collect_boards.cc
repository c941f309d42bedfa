#include "calib/detect/collect_boards.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib {

std::optional<int64_t> StepOf(const Footage& footage, int64_t frame_idx) {
  if (footage.step_of_frame.empty()) return frame_idx;
  const auto found = footage.step_of_frame.find(frame_idx);
  return found == footage.step_of_frame.end() ? std::nullopt : std::optional<int64_t>(found->second);
}

size_t CommonLayout(const std::vector<CameraResults>& results, size_t b, size_t num_layouts) {
  std::vector<int64_t> corners(num_layouts, 0);
  for (const CameraResults& camera : results) {
    for (const Searched& image : camera.images) {
      for (size_t l = 0; l < num_layouts; ++l) corners[l] += NumCornersSeen(image.boards[b][l]);
    }
  }
  return std::max_element(corners.begin(), corners.end()) - corners.begin();
}

namespace {

/// Boards of which kSoftMisfit finds more than twice the corners, and all that either limit finds.
struct SoftCount {
  int soft = 0, seen = 0;
  bool most() const { return 2 * soft > seen; }
};

SoftCount CountSoft(const BoardOfCamera& board) {
  SoftCount count;
  for (const Searched& image : board.results.images) {
    const BoardDetection& found = image.boards[board.b][board.layout];
    count.soft += !found.soft.empty();
    count.seen += found.seen();
  }
  return count;
}

/// How much less a soft board's corners count than those of the camera's sharp ones: by their distances from a smooth surface.
double RelativeSigma(const BoardOfCamera& board, double sigma_px) {
  constexpr double kMost = 5;
  std::vector<double> sharp;
  for (const Searched& image : board.results.images) {
    const BoardDetection& found = image.boards[board.b][board.layout];
    if (found.status == Status::kOk && found.soft.empty() && found.sigma_px > 0) sharp.push_back(found.sigma_px);
  }
  return sharp.empty() ? 1 : std::clamp(sigma_px / UpperMedian(sharp), 1.0, kMost);
}

std::string SoftNote(const SoftCount& count, const std::string& prefix) {
  const std::string boards = prefix + Format(
                                          "%d of %d boards keep less than half of their corners at a misfit of %g (soft, noisy "
                                          "or interlaced images, or markers with a thin white rim)",
                                          count.soft, count.seen, kSharpMisfit);
  return count.most() ? boards + Format(": all corners up to %g are taken; option 'max-misfit' %g leaves them out", kSoftMisfit,
                                        kSharpMisfit)
                      : boards + Format(" and were taken as blurred; option 'max-misfit' %g takes them in", kSoftMisfit);
}

}  // namespace

void Collect(const BoardOfCamera& board, int camera_idx, FootageDetections* found) {
  const SoftCount soft = CountSoft(board);
  if (soft.soft > 0) found->soft.push_back({SoftNote(soft, board.prefix), soft.most(), 10 * soft.soft > soft.seen});
  for (const Searched& image : board.results.images) {
    const std::optional<int64_t> step = StepOf(board.footage, image.frame_idx);
    if (!step) {
      ++found->reasons["no time step"];
      continue;
    }
    const BoardDetection& seen = image.boards[board.b][board.layout];
    const bool take_soft = soft.most() && !seen.soft.empty();
    BoardDetection result = take_soft ? seen.soft[0] : seen;
    if (take_soft) result.detection.sigma_px = RelativeSigma(board, result.sigma_px);
    if (result.status != Status::kOk) {
      ++found->reasons[board.prefix + result.reason];
      if (board.b == 0) found->unused[result.reason].push_back(*step);
      continue;
    }
    result.detection.camera_idx = camera_idx;
    result.detection.frame_idx = *step;
    result.detection.board_idx = static_cast<int>(board.b);
    found->num_corners_dropped += result.num_found - result.detection.num_corners();
    found->detections.push_back(std::move(result.detection));
  }
}

void DropUsed(FootageDetections* found) {
  std::set<int64_t> used;
  for (const Detection& detection : found->detections) used.insert(detection.frame_idx);
  for (auto& [reason, steps] : found->unused)
    steps.erase(std::remove_if(steps.begin(), steps.end(), [&](int64_t step) { return used.count(step) > 0; }), steps.end());
}

std::string LayoutNote(const Board& board, const Board& layout) {
  std::string how;
  if (layout.legacy != board.legacy) how = "in the legacy layout";
  if (layout.inverted != board.inverted) how += std::string(how.empty() ? "" : " and ") + "with black and white exchanged";
  return "board " + ToString(board) + " is printed " + how + ": " + ToString(layout);
}

}  // namespace mvstudio::calib
