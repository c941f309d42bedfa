#include "calib/detect/detect_footage.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "calib/detect/collect_boards.h"
#include "calib/detect/detection_cache.h"
#include "core/check.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "core/text/shell_word.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kMirrorChecks = 20;  // images of a camera that are also looked at in a mirror when no marker is found

/// Progress of several threads.
class SharedStage {
 public:
  SharedStage(const RunContext& run, int64_t total) : stage_(run, "finding boards", total) {}
  void Advance(int64_t done, const std::string& note) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_.Advance(done, note);
  }

 private:
  std::mutex mutex_;
  ProgressStage stage_;
};

/// Whether a frame is searched. Without thinning all are, so that what is cached does not depend on the time steps.
bool IsSearched(const Footage& footage, int64_t frame_idx, int stride) {
  if (stride == 1) return true;
  const std::optional<int64_t> step = StepOf(footage, frame_idx);
  return step && *step % stride == 0;
}

/// What determines the frames that are searched: the files' contents and, with thinning, the time steps.
std::optional<std::string> DigestOf(const Footage& footage, int stride) {
  const std::optional<std::string> digest = ContentDigest(footage.path);
  if (!digest || stride == 1 || footage.step_of_frame.empty()) return digest;
  const std::string text = *digest + Join(footage.step_of_frame, ";", [](const auto& row) {
    return std::to_string(row.first) + ":" + std::to_string(row.second);
  });
  return Sha256Hex(text.data(), text.size());
}

int Stride(const std::vector<Footage>& footage, const FootageOptions& options) {
  if (options.every < 1) throw UsageError("option 'every' must be 1 or more");
  if (options.max_frames < 0) throw UsageError("option 'max-frames' must not be negative");
  int64_t longest = 0;
  for (const Footage& f : footage) longest = std::max(longest, f.num_frames);
  if (options.max_frames == 0) return options.every;
  const int64_t thinning = (longest / options.every + options.max_frames - 1) / options.max_frames;
  return options.every * static_cast<int>(std::max<int64_t>(1, thinning));
}

/// `seen`: labels of the camera's frames by number.
void CheckFrame(const Footage& footage, const FootageFrame& frame, std::map<int64_t, std::string>* seen, CameraInput* camera) {
  if (camera->width_px == 0) camera->width_px = frame.image.width, camera->height_px = frame.image.height;
  const auto size = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
  if (frame.image.width != camera->width_px || frame.image.height != camera->height_px) {
    throw FormatError(footage.path, frame.label,
                      "camera " + footage.camera + ": the image is " + size(frame.image.width, frame.image.height) +
                          " but the first was " + size(camera->width_px, camera->height_px) +
                          "; a camera's images must all have one size");
  }
  const auto [first, is_new] = seen->emplace(frame.frame_idx, frame.label);
  if (!is_new) {
    throw FormatError(footage.path, frame.label,
                      "camera " + footage.camera + " has number " + std::to_string(frame.frame_idx) + " twice, first in " +
                          first->second +
                          "; images of several cameras are paired by the number in their names: a pattern in quotes, whose "
                          "`*` stands for the frame, takes those of one camera ('both/*_0.jpg')");
  }
}

std::string HintFor(const Board& board, Detector detector) {
  if (board.kind == Board::Kind::kChessboard) {
    return "the numbers of INNER corners, that the whole board is visible and sharp" +
           std::string(detector == Detector::kFast ? ", or try option 'detector' exact" : "");
  }
  if (board.is_round()) return "the numbers of circles, and that the whole grid is visible and sharp";
  if (board.has_tags()) return "the family, the ids and the numbers of tags";
  return "the numbers of squares, the dictionary, and whether the layout is legacy";
}

std::string NeverSeen(const std::vector<Board>& boards, const Footage& footage, const FootageDetections& found,
                      Detector detector) {
  const std::string why =
      Join(found.reasons, ", ", [](const auto& reason) { return reason.first + ": " + std::to_string(reason.second); });
  const std::string names = Join(boards, " or ", [](const Board& board) { return ToString(board); });
  const bool mirrored = std::any_of(found.reasons.begin(), found.reasons.end(),
                                    [](const auto& reason) { return reason.first.find(kMirroredReason) != std::string::npos; });
  if (mirrored) {
    return "camera " + footage.camera + ": the board " + names + " can be read only in a mirror (" + why +
           "); if its images are flipped left-right, say so with option 'mirrored' " + ShellWord(footage.camera) +
           "; if it looks at the back of a board, printed through or on both sides, two-sided=THICKNESS in option 'board'";
  }
  return "camera " + footage.camera + ": the board " + names + " was not found in any of " + std::to_string(found.num_images) +
         " images" + (why.empty() ? "" : " (" + why + ")") + "; check " + HintFor(boards.front(), detector) +
         ", or let `mvstudio board check` find out what fits";
}

/// Hands out the frames of one camera, to one thread at a time.
class FrameQueue {
 public:
  /// With `tolerant`, unusable images end the camera and become its failure.
  FrameQueue(Footage* footage, int stride, bool tolerant) : footage_(footage), stride_(stride), tolerant_(tolerant) {}

  struct Frame {
    size_t position = 0;  // among the searched frames
    FootageFrame frame;
  };
  /// The next frame to be searched; nothing at the end, or when another thread is reading and `wait` is not set.
  std::optional<Frame> Take(bool wait) {
    std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
    wait ? lock.lock() : static_cast<void>(lock.try_lock());
    if (!lock.owns_lock()) return std::nullopt;
    try {
      if (auto frame = Next()) return frame;
    } catch (const FormatError& error) {
      if (!tolerant_) throw;
      failure_ = error.what();
      if (failure_.rfind(error.path() + ": ", 0) == 0) failure_.erase(0, error.path().size() + 2);
    }
    done_ = true;
    return std::nullopt;
  }
  void Stop() { done_ = true; }
  bool done() const { return done_; }

  void Keep(size_t position, Searched searched, double search_s) {
    const std::lock_guard<std::mutex> lock(results_mutex_);
    search_s_ += search_s;
    if (results_.size() <= position) results_.resize(position + 1);
    results_[position] = std::move(searched);
  }
  std::vector<Searched> TakeResults() { return std::move(results_); }
  const CameraInput& camera() const { return camera_; }
  const std::string& name() const { return footage_->camera; }
  const std::string& failure() const { return failure_; }
  int64_t num_read() const { return num_read_; }
  double read_s() const { return read_s_; }
  double search_s() const { return search_s_; }

 private:
  std::optional<FootageFrame> Read() {
    const Stopwatch watch;
    std::optional<FootageFrame> frame = footage_->next();
    read_s_ += watch.Seconds(), num_read_ += frame.has_value();
    return frame;
  }

  std::optional<Frame> Next() {
    while (!done_) {
      auto frame = Read();
      if (!frame) break;
      CheckFrame(*footage_, *frame, &seen_, &camera_);
      if (!IsSearched(*footage_, frame->frame_idx, stride_)) continue;
      if (footage_->mirrored) frame->image = FlippedLeftRight(frame->image);
      return Frame{num_taken_++, std::move(*frame)};
    }
    return std::nullopt;
  }

  Footage* footage_;
  int stride_;
  bool tolerant_;
  std::string failure_;
  std::mutex mutex_, results_mutex_;
  std::map<int64_t, std::string> seen_;
  CameraInput camera_;
  std::atomic<bool> done_{false};
  size_t num_taken_ = 0;
  int64_t num_read_ = 0;
  double read_s_ = 0, search_s_ = 0;
  std::vector<Searched> results_;
};

/// A frame of any queue, beginning with `first` so that the threads read different cameras while they can.
std::optional<std::pair<FrameQueue*, FrameQueue::Frame>> TakeAny(std::vector<std::unique_ptr<FrameQueue>>& queues,
                                                                 size_t first) {
  for (const bool wait : {false, true}) {
    for (size_t k = 0; k < queues.size(); ++k) {
      FrameQueue& queue = *queues[(first + k) % queues.size()];
      if (queue.done()) continue;
      if (auto frame = queue.Take(wait)) return std::make_pair(&queue, std::move(*frame));
    }
  }
  return std::nullopt;
}

void SearchAll(const std::vector<Board>& boards, std::vector<std::unique_ptr<FrameQueue>>& queues, const DetectOptions& options,
               const RunContext& run, SharedStage* stage) {
  const int num_threads = ResolveThreads(run.num_threads);
  const auto work = [&](int64_t thread) {
    try {
      while (auto taken = TakeAny(queues, thread)) {
        auto& [queue, frame] = *taken;
        DetectOptions detect = options;
        detect.check_mirror = options.check_mirror && frame.position < kMirrorChecks;
        const Stopwatch watch;
        Searched searched{frame.frame.frame_idx, DetectBoards(boards, frame.frame.image, detect)};
        queue->Keep(frame.position, std::move(searched), watch.Seconds());
        stage->Advance(1, queue->name());
      }
    } catch (...) {
      for (auto& queue : queues) queue->Stop();
      throw;
    }
  };
  ParallelFor(num_threads, num_threads, work);
}

bool LoadCamera(const DetectionCache& cache, const std::vector<Board>& boards, const DetectOptions& options, int stride,
                CameraResults* results) {
  for (const Board& board : boards) {
    auto stored = cache.Load(DetectionKey(*results->digest, board, options, stride));
    if (!stored) return false;
    if (results->images.empty()) results->images.resize(stored->images.size());
    if (results->images.size() != stored->images.size()) return false;
    results->camera.width_px = stored->width_px, results->camera.height_px = stored->height_px;
    for (size_t i = 0; i < stored->images.size(); ++i) {
      if (stored->images[i].layouts.size() != LayoutsOf(board).size()) return false;
      results->images[i].frame_idx = stored->images[i].frame_idx;
      results->images[i].boards.push_back(std::move(stored->images[i].layouts));
    }
  }
  return true;
}

void StoreCamera(const DetectionCache& cache, const std::vector<Board>& boards, const DetectOptions& options, int stride,
                 const CameraResults& results) {
  for (size_t b = 0; b < boards.size(); ++b) {
    StoredFootage stored{results.camera.width_px, results.camera.height_px, {}};
    for (const Searched& image : results.images) stored.images.push_back({image.frame_idx, image.boards[b]});
    cache.Store(DetectionKey(*results.digest, boards[b], options, stride), stored);
  }
}

std::vector<CameraResults> LoadOrSearch(const std::vector<Board>& boards, std::vector<Footage>& footage,
                                        const FootageOptions& options, const RunContext& run) {
  const int stride = Stride(footage, options);
  int64_t total = 0;
  for (const Footage& f : footage) total += f.num_frames / stride;
  SharedStage stage(run, total);
  const DetectionCache cache(options.cache);
  std::vector<CameraResults> results(footage.size());
  ParallelFor(static_cast<int64_t>(footage.size()), run.num_threads, [&](int64_t c) {
    if (cache.enabled()) results[c].digest = DigestOf(footage[c], stride);
    if (!results[c].digest) return;
    if (footage[c].mirrored) *results[c].digest += "-mirrored";
    results[c].cached = LoadCamera(cache, boards, options.detect, stride, &results[c]);
    if (!results[c].cached) results[c].camera = CameraInput(), results[c].images.clear();
    if (results[c].cached) stage.Advance(static_cast<int64_t>(results[c].images.size()), footage[c].camera);
  });
  std::vector<std::unique_ptr<FrameQueue>> queues;
  std::vector<size_t> camera_of;
  for (size_t c = 0; c < footage.size(); ++c) {
    if (results[c].cached) continue;
    queues.push_back(std::make_unique<FrameQueue>(&footage[c], stride, !options.all_cameras));
    camera_of.push_back(c);
  }
  SearchAll(boards, queues, options.detect, run, &stage);
  for (size_t q = 0; q < queues.size(); ++q) {
    CameraResults& camera = results[camera_of[q]];
    camera.camera = queues[q]->camera();
    camera.failure = queues[q]->failure();
    camera.num_read = queues[q]->num_read(), camera.read_s = queues[q]->read_s(), camera.search_s = queues[q]->search_s();
    if (camera.failure.empty()) camera.images = queues[q]->TakeResults();
    if (camera.digest && camera.failure.empty()) StoreCamera(cache, boards, options.detect, stride, camera);
  }
  return results;
}

}  // namespace

std::vector<FootageDetections> DetectFootage(const std::vector<Board>& boards, std::vector<Footage>& footage,
                                             const FootageOptions& options, const RunContext& run) {
  MVS_CHECK(!boards.empty() && !footage.empty(), boards.size() << " boards, " << footage.size() << " cameras");
  const std::vector<CameraResults> results = LoadOrSearch(boards, footage, options, run);
  std::vector<FootageDetections> found(footage.size());
  for (size_t b = 0; b < boards.size(); ++b) {
    const std::vector<Board> layouts = LayoutsOf(boards[b]);
    const size_t layout = CommonLayout(results, b, layouts.size());
    const std::string prefix = boards.size() > 1 ? ToString(boards[b]) + ": " : "";
    size_t num_seen = 0;
    for (size_t c = 0; c < footage.size(); ++c) {
      const size_t before = found[c].detections.size();
      Collect({results[c], footage[c], b, layout, prefix}, static_cast<int>(c), &found[c]);
      const bool seen = found[c].detections.size() > before;
      num_seen += seen;
      if (layout > 0 && seen) found[c].notes.push_back(LayoutNote(boards[b], layouts[layout]));
    }
    if (num_seen == 0 && boards.size() > 1)
      found[0].notes.push_back("board " + ToString(boards[b]) + " was never seen by any camera");
  }
  for (size_t c = 0; c < footage.size(); ++c) {
    found[c].camera = results[c].camera;
    found[c].camera.name = footage[c].camera;
    found[c].num_images = static_cast<int>(results[c].images.size());
    found[c].cached = results[c].cached, found[c].num_read = results[c].num_read;
    found[c].read_s = results[c].read_s, found[c].search_s = results[c].search_s;
    DropUsed(&found[c]);
    std::stable_sort(found[c].detections.begin(), found[c].detections.end(),
                     [](const Detection& a, const Detection& d) { return a.frame_idx < d.frame_idx; });
    if (!found[c].detections.empty()) continue;
    found[c].failure = results[c].failure;
    if (found[c].failure.empty()) found[c].failure = NeverSeen(boards, footage[c], found[c], options.detect.detector);
  }
  const auto failed = [](const FootageDetections& camera) { return !camera.failure.empty(); };
  const auto first = std::find_if(found.begin(), found.end(), failed);
  const bool refuse = options.all_cameras ? first != found.end() : std::all_of(found.begin(), found.end(), failed);
  if (refuse) throw FormatError(footage[static_cast<size_t>(first - found.begin())].path, "", first->failure);
  return found;
}

std::vector<FootageDetections> DetectFootage(const Board& board, std::vector<Footage>& footage, const FootageOptions& options,
                                             const RunContext& run) {
  return DetectFootage(std::vector<Board>{board}, footage, options, run);
}

CalibrateInput ToCalibrateInput(const std::vector<Board>& boards, const std::vector<FootageDetections>& found) {
  CalibrateInput input;
  input.boards = boards;
  for (const FootageDetections& camera : found) {
    input.cameras.push_back(camera.camera);
    input.num_corners_dropped += camera.num_corners_dropped;
    input.detections.insert(input.detections.end(), camera.detections.begin(), camera.detections.end());
  }
  return input;
}

}  // namespace mvstudio::calib
