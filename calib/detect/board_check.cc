#include "calib/detect/board_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <set>

#include "calib/detect/board_candidates.h"
#include "calib/detect/detect_board.h"
#include "core/check.h"
#include "core/format.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

/// The candidate in its best layout, counted over all images.
BoardTrial Try(const Candidate& candidate, const TrialImages& trial_images, Detector detector, int num_threads) {
  const std::vector<Image>& images = trial_images.For(candidate.mirrored);
  DetectOptions options;
  options.detector = detector;
  options.check_mirror = false;
  std::vector<std::vector<BoardDetection>> found(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads,
              [&](int64_t i) { found[i] = DetectBoards({candidate.board}, images[i], options)[0]; });
  BoardTrial best;
  const std::vector<Board> layouts = LayoutsOf(candidate.board);
  for (size_t l = 0; l < layouts.size(); ++l) {
    BoardTrial trial;
    trial.board = layouts[l];
    trial.mirrored = candidate.mirrored;
    std::vector<double> sigmas;
    for (const auto& detections : found) {
      if (!detections[l].seen()) continue;
      ++trial.num_images;
      trial.num_corners += NumCornersSeen(detections[l]);
      sigmas.push_back((detections[l].soft.empty() ? detections[l] : detections[l].soft[0]).sigma_px);
    }
    if (!sigmas.empty()) trial.residual_px = UpperMedian(sigmas);
    if (l == 0 || trial.num_corners > best.num_corners) best = trial;
  }
  return best;
}

std::string RelationOf(const Board& board, bool mirrored, const std::optional<Board>& given) {
  if (!given) return mirrored ? "found in the mirrored images" : "found in the images";
  std::vector<std::string> parts;
  if (mirrored) parts.push_back("in the mirrored images");
  if (board.kind != given->kind) {
    parts.push_back("another kind of board");
  } else {
    const int dc = board.cols - given->cols, dr = board.rows - given->rows;
    const bool exchanged = board.cols == given->rows && board.rows == given->cols && dc != 0;
    if (exchanged) parts.push_back("rows and columns exchanged");
    if (!exchanged && dc == dr && dc == -1) parts.push_back("the given numbers count squares, not inner corners");
    if (!exchanged && dc == dr && dc == 1) parts.push_back("the given numbers count inner corners, not squares");
    if (!exchanged && (dc != dr || std::abs(dc) > 1)) parts.push_back("other numbers of rows and columns");
    if (board.dictionary != given->dictionary) parts.push_back(board.has_tags() ? "another family" : "another dictionary");
    if (board.legacy != given->legacy) parts.push_back(board.legacy ? "legacy layout" : "layout of OpenCV 4.6");
    if (board.inverted != given->inverted) parts.push_back("black and white exchanged");
    if (board.first_tag != given->first_tag) parts.push_back("other first tag");
    if (std::abs(board.tag_spacing - given->tag_spacing) > 1e-9) parts.push_back("another gap");
    if (std::abs(board.marker_m - given->marker_m) > 1e-9) parts.push_back("another size of the markers");
  }
  return parts.empty() ? "as given" : Join(parts, ", ");
}

/// Candidates tried in a few images first: a search for a chessboard that is not there takes seconds where another one is.
class Trials {
 public:
  Trials(const std::optional<Board>& given, const TrialImages& all, const TrialImages& few, int num_threads,
         BoardCheckReport* report)
      : given_(given), all_(all), few_(few), num_threads_(num_threads), report_(report) {}

  /// Those that were added since the last time: in all images when the few show them.
  void TryNew(const Candidates& candidates) {
    for (size_t i = report_->trials.size(); i < candidates.list().size(); ++i) {
      report_->trials.emplace_back();
      in_few_alone_.push_back(all_.grey.size() > few_.grey.size());
      if (in_few_alone_[i]) Put(i, candidates.list()[i], few_, Detector::kFast);
      if (!in_few_alone_[i] || report_->trials[i].num_images > 0) TryInAll(i, candidates.list()[i]);
    }
  }
  /// Those that the few did not show.
  void TryRest(const Candidates& candidates) {
    for (size_t i = 0; i < report_->trials.size(); ++i) {
      if (in_few_alone_[i]) TryInAll(i, candidates.list()[i]);
    }
  }
  void Put(size_t i, const Candidate& candidate, const TrialImages& trial_images, Detector detector) {
    report_->trials[i] = Try(candidate, trial_images, detector, num_threads_);
    report_->trials[i].relation = RelationOf(report_->trials[i].board, candidate.mirrored, given_);
  }

 private:
  void TryInAll(size_t i, const Candidate& candidate) {
    Put(i, candidate, all_, Detector::kFast);
    in_few_alone_[i] = false;
  }

  const std::optional<Board>& given_;
  const TrialImages &all_, &few_;
  int num_threads_;
  BoardCheckReport* report_;
  std::vector<bool> in_few_alone_;
};

void Sort(BoardCheckReport* report) {
  std::stable_sort(report->trials.begin(), report->trials.end(), [](const BoardTrial& a, const BoardTrial& b) {
    const auto rank = [](const BoardTrial& t) {
      return std::make_pair(t.num_corners, t.board.kind != Board::Kind::kChessboard);
    };
    return rank(a) > rank(b);
  });
  report->best.reset();
  if (!report->trials.empty() && report->trials.front().num_images > 0) report->best = 0;
}

/// Whether some trial was found in at least a share of the images.
bool Fits(const BoardCheckReport& report, double share) {
  return std::any_of(report.trials.begin(), report.trials.end(),
                     [&](const BoardTrial& t) { return t.num_images > 0 && t.num_images >= share * report.num_images; });
}

/// Whether a board is in half of the images; lone tags may hang on any wall.
bool HasBoard(const BoardCheckReport& report, bool tags_count) {
  return std::any_of(report.trials.begin(), report.trials.end(), [&](const BoardTrial& t) {
    return (tags_count || t.board.kind != Board::Kind::kTag) && t.num_images > 0 && 2 * t.num_images >= report.num_images;
  });
}

/// The slow search for the chessboard that came out best, unless it is in all images already.
void TryHarder(const TrialImages& trial_images, Trials* trials, BoardCheckReport* report) {
  if (!report->best || report->trials[0].board.kind != Board::Kind::kChessboard) return;
  if (report->trials[0].num_images == report->num_images) return;
  trials->Put(0, {report->trials[0].board, report->trials[0].mirrored}, trial_images, Detector::kExact);
}

}  // namespace

BoardCheckReport CheckBoard(const std::optional<Board>& given, const std::vector<Image>& images, const RunContext& run) {
  MVS_CHECK(!images.empty(), "no images");
  const TrialImages trial_images = Prepare(images), few = AFew(trial_images);
  const int num_threads = run.num_threads;
  BoardCheckReport report;
  report.num_images = static_cast<int>(images.size());
  report.scale_known = given.has_value();
  Candidates candidates(given);
  Trials trials(given, trial_images, few, num_threads, &report);
  ProgressStage stage(run, "looking for boards", 4);
  if (given) AddMiscounts(*given, &candidates);
  trials.TryNew(candidates);
  stage.Advance(1, "the given board");
  const bool tags_asked = given && given->has_tags(), circles_asked = given && given->is_round();
  MarkerKinds shown;  // a search for each family and dictionary takes seconds a photograph
  const auto add_marked = [&](const TrialImages& where, Candidates* to) {
    const MarkerKinds kinds = shown;
    report.tags.clear(), report.markers.clear();
    if (!Fits(report, 0.8) || tags_asked) AddTagGuesses(given, where, kinds, num_threads, to, &report.tags, &shown);
    if (!Fits(report, 0.8) && !tags_asked) AddCharucoGuesses(given, where, kinds, num_threads, to, &report.markers, &shown);
    return !report.tags.empty() || !report.markers.empty() || to->list().size() > report.trials.size();
  };
  const auto try_chessboards = [&] {
    if (Fits(report, 0.5) || tags_asked || circles_asked) return;
    for (const Board& board : GuessChessboards(few, num_threads)) {
      candidates.AddGuess(board, false);
      trials.TryNew(candidates);
      if (Fits(report, 0.8)) return;
    }
  };
  Candidates scratch = candidates;  // a chessboard with markers in its squares is no chessboard
  if (few.grey.size() < trial_images.grey.size() && !add_marked(few, &scratch)) try_chessboards();
  stage.Advance(1, "chessboards in a few images");
  const bool of_few = !shown.empty();
  add_marked(trial_images, &candidates);
  trials.TryNew(candidates);
  if (of_few && !HasBoard(report, tags_asked)) {  // what the few show may be clutter, or another board
    shown.clear(), add_marked(trial_images, &candidates);
    trials.TryNew(candidates);
  }
  stage.Advance(1, "AprilTag families and ArUco dictionaries");
  try_chessboards();
  if (!Fits(report, 0.5) && !tags_asked) AddCircleGuesses(trial_images, num_threads, &candidates);
  trials.TryNew(candidates);
  if (!Fits(report, 0.5)) trials.TryRest(candidates);
  Sort(&report);
  TryHarder(trial_images, &trials, &report);
  stage.Advance(1, "chessboards and circles");
  return report;
}

std::string BoardText(const Board& board, bool scale_known) {
  const std::string text = ToString(board);
  if (scale_known) return text;
  Board unit = board;
  unit.square_m = 1;
  unit.circle_m = board.circle_m / board.square_m;
  unit.marker_m = board.marker_m / board.square_m;
  std::string unscaled = ToString(unit);
  const std::string side = "1000mm", name = board.has_tags() ? "SIDE" : board.is_round() ? "STEP" : "SQUARE";
  const size_t at = unscaled.find(":" + side);
  if (at != std::string::npos) unscaled.replace(at + 1, side.size(), name);
  if (board.kind != Board::Kind::kCharuco) return unscaled;
  const size_t marker = unscaled.find(':', at + 1) + 1, end = unscaled.find(':', marker);
  return unscaled.substr(0, marker) + Format("%.3g*", unit.marker_m) + name + unscaled.substr(end);
}

}  // namespace mvstudio::calib
