#include "calib/detect_footage.h"

#include <algorithm>
#include <mutex>
#include <set>

#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

/// Progress of several threads.
class SharedStage {
 public:
  SharedStage(const RunContext& run, int64_t total) : stage_(run, "finding boards", total) {}
  void Advance(const std::string& note) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_.Advance(1, note);
  }

 private:
  std::mutex mutex_;
  ProgressStage stage_;
};

int Stride(const std::vector<Footage>& footage, const FootageOptions& options) {
  if (options.every < 1) throw UsageError("--every must be 1 or more");
  if (options.max_frames < 0) throw UsageError("--max-frames must not be negative");
  int64_t longest = 0;
  for (const Footage& f : footage) longest = std::max(longest, f.num_frames);
  if (options.max_frames == 0) return options.every;
  const int64_t thinning = (longest / options.every + options.max_frames - 1) / options.max_frames;
  return options.every * static_cast<int>(std::max<int64_t>(1, thinning));
}

void CheckFrame(const Footage& footage, const FootageFrame& frame, std::set<int64_t>* seen, CameraInput* camera) {
  if (camera->width_px == 0) camera->width_px = frame.image.width, camera->height_px = frame.image.height;
  const auto size = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
  if (frame.image.width != camera->width_px || frame.image.height != camera->height_px) {
    throw FormatError(footage.path, frame.label,
                      "camera " + footage.camera + ": the image is " + size(frame.image.width, frame.image.height) +
                          " but the first was " + size(camera->width_px, camera->height_px) +
                          "; a camera's images must all have one size");
  }
  if (!seen->insert(frame.frame_idx).second) {
    throw FormatError(footage.path, frame.label,
                      "camera " + footage.camera + " has number " + std::to_string(frame.frame_idx) +
                          " twice; images of several cameras are paired by the last number in their names");
  }
}

std::string NeverSeen(const Board& board, const Footage& footage, const FootageDetections& found) {
  std::string why;
  for (const auto& [reason, count] : found.reasons) why += (why.empty() ? "" : ", ") + reason + ": " + std::to_string(count);
  const bool chessboard = board.kind == Board::Kind::kChessboard;
  return "camera " + footage.camera + ": the board " + ToString(board) + " was not found in any of " +
         std::to_string(found.num_images) + " images" + (why.empty() ? "" : " (" + why + ")") + "; check " +
         (chessboard ? "the numbers of INNER corners, that the whole board is visible and sharp, or try --detector exact"
                     : "the numbers of squares, the dictionary, and whether the layout is legacy");
}

FootageDetections DetectCamera(const Board& board, Footage& footage, int camera_idx, int stride, const FootageOptions& options,
                               SharedStage* stage) {
  FootageDetections found;
  found.camera.name = footage.camera;
  std::set<int64_t> seen;
  while (auto frame = footage.next()) {
    CheckFrame(footage, *frame, &seen, &found.camera);
    if (frame->frame_idx % stride != 0) continue;
    BoardDetection result = DetectBoard(board, frame->image, options.detect);
    ++found.num_images;
    stage->Advance(footage.camera);
    if (result.status != Status::kOk) {
      ++found.reasons[result.reason];
      continue;
    }
    result.detection.camera_idx = camera_idx;
    result.detection.frame_idx = frame->frame_idx;
    found.num_corners_dropped += result.num_found - result.detection.num_corners();
    found.detections.push_back(std::move(result.detection));
  }
  if (found.detections.empty()) throw FormatError(footage.path, "", NeverSeen(board, footage, found));
  return found;
}

}  // namespace

std::vector<FootageDetections> DetectFootage(const Board& board, std::vector<Footage>& footage, const FootageOptions& options,
                                             const RunContext& run) {
  MVS_CHECK(!footage.empty(), "no footage");
  const int stride = Stride(footage, options);
  int64_t total = 0;
  for (const Footage& f : footage) total += f.num_frames / stride;
  SharedStage stage(run, total);
  std::vector<FootageDetections> found(footage.size());
  ParallelFor(static_cast<int64_t>(footage.size()), run.num_threads,
              [&](int64_t c) { found[c] = DetectCamera(board, footage[c], static_cast<int>(c), stride, options, &stage); });
  return found;
}

CalibrateInput ToCalibrateInput(const Board& board, const std::vector<FootageDetections>& found) {
  CalibrateInput input;
  input.board = board;
  for (const FootageDetections& camera : found) {
    input.cameras.push_back(camera.camera);
    input.num_corners_dropped += camera.num_corners_dropped;
    input.detections.insert(input.detections.end(), camera.detections.begin(), camera.detections.end());
  }
  return input;
}

}  // namespace mvstudio::calib
