#include "calib/detect/board_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <set>

#include "calib/board/apriltag.h"
#include "calib/board/charuco_layout.h"
#include "calib/board/guess.h"
#include "calib/detect/corner_search.h"
#include "calib/detect/detect_board.h"
#include "core/check.h"
#include "core/format.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr int kChessboardLooks = 5;   // images in which the size of a chessboard is searched
constexpr int kFewTags = 100;         // families with so few tags match clutter: they count only on request
constexpr int kLeastMarkersSeen = 3;  // in all images together, for a dictionary to count as seen

/// The dictionaries that hold all others as their beginning.
constexpr const char* kWholeDictionaries[] = {"4x4_1000",      "5x5_1000",       "6x6_1000",
                                              "7x7_1000",      "aruco_original", "apriltag_16h5",
                                              "apriltag_25h9", "apriltag_36h10", "apriltag_36h11"};

Image Negative(Image grey) {
  for (uint8_t& value : grey.pixels) value = 255 - value;
  return grey;
}

/// The images as they are, mirrored, and in negative.
struct Pictures {
  std::vector<Image> grey, mirrored, negative;
  const std::vector<Image>& For(bool in_mirror) const { return in_mirror ? mirrored : grey; }
};

Pictures Prepare(const std::vector<Image>& images) {
  Pictures pictures;
  for (const Image& image : images) {
    pictures.grey.push_back(ToGrey(image));
    pictures.mirrored.push_back(FlippedLeftRight(pictures.grey.back()));
    pictures.negative.push_back(Negative(pictures.grey.back()));
  }
  return pictures;
}

/// A board to pass to FindMarkers.
Board AnyCharuco(const std::string& dictionary) {
  Board board;
  board.kind = Board::Kind::kCharuco;
  board.dictionary = dictionary;
  board.cols = board.rows = 2;
  board.square_m = 1, board.marker_m = 0.5;
  return board;
}

std::vector<MarkersOfImage> MarkersIn(const std::vector<Image>& images, const std::string& dictionary, int num_threads) {
  std::vector<MarkersOfImage> found(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads,
              [&](int64_t i) { found[i] = FindMarkers(AnyCharuco(dictionary), images[i], false).px; });
  return found;
}

int Count(const std::vector<MarkersOfImage>& images) {
  size_t count = 0;
  for (const MarkersOfImage& markers : images) count += markers.size();
  return static_cast<int>(count);
}

/// `images` hold some.
SeenMarkers Seen(const std::string& dictionary, const std::vector<MarkersOfImage>& images) {
  SeenMarkers seen{dictionary};
  std::set<int> ids;
  for (const MarkersOfImage& markers : images) {
    seen.num_images += !markers.empty();
    for (const auto& [id, px] : markers) ids.insert(id);
  }
  seen.smallest_id = *ids.begin(), seen.largest_id = *ids.rbegin(), seen.num_ids = static_cast<int>(ids.size());
  return seen;
}

/// 4x4 of 4x4_1000: dictionaries of one kind differ in length only.
std::string FamilyOf(const std::string& dictionary) {
  return dictionary.rfind("apriltag", 0) == 0 || dictionary.find("x") == std::string::npos
             ? dictionary
             : dictionary.substr(0, dictionary.find('_'));
}

struct Candidate {
  Board board;
  bool mirrored = false;
};

/// Collects the boards to be tried; lengths come from the given board where there is one.
class Candidates {
 public:
  explicit Candidates(const std::optional<Board>& given) : given_(given) {
    if (given) Add(*given, false);
  }

  void Add(Board board, bool mirrored) {
    if (board.cols < 1 || board.rows < 1) return;
    if (board.kind == Board::Kind::kChessboard && std::min(board.cols, board.rows) < 3) return;
    if (board.kind == Board::Kind::kCharuco && std::min(board.cols, board.rows) < 2) return;
    if (!seen_.insert(ToString(board) + (mirrored ? " mirrored" : "")).second) return;
    list_.push_back({std::move(board), mirrored});
  }
  /// A board that was guessed with square_m = 1.
  void AddGuess(Board board, bool mirrored) {
    const double scale = given_ ? given_->square_m : 1;
    board.square_m = scale;
    board.marker_m *= scale;
    const bool alike = given_ && given_->kind == board.kind;
    if (alike && FamilyOf(board.dictionary) == FamilyOf(given_->dictionary)) board.dictionary = given_->dictionary;
    const bool same_ratio =
        alike && board.kind == Board::Kind::kCharuco && std::abs(board.marker_m - given_->marker_m) < 0.03 * scale;
    if (same_ratio) board.marker_m = given_->marker_m;
    if (alike && board.kind == Board::Kind::kAprilGrid && std::abs(board.tag_spacing - given_->tag_spacing) < 0.03) {
      board.tag_spacing = given_->tag_spacing;
    }
    Add(std::move(board), mirrored);
  }
  const std::vector<Candidate>& list() const { return list_; }

 private:
  std::optional<Board> given_;
  std::set<std::string> seen_;
  std::vector<Candidate> list_;
};

/// Rows and columns exchanged; squares counted for corners (or the reverse), and both.
void AddMiscounts(const Board& given, Candidates* candidates) {
  if (given.kind != Board::Kind::kChessboard && given.kind != Board::Kind::kCharuco && given.kind != Board::Kind::kAprilGrid)
    return;
  for (const int more : {0, -1, 1}) {
    for (const bool exchanged : {false, true}) {
      Board board = given;
      if (exchanged) std::swap(board.cols, board.rows);
      board.cols += more, board.rows += more;
      if (board.has_tags() && more != 0) continue;
      candidates->Add(board, false);
    }
  }
}

/// ChArUco boards that the markers tell, in any dictionary, also mirrored and in negative.
void AddCharucoGuesses(const std::optional<Board>& given, const Pictures& pictures, int num_threads, Candidates* candidates,
                       std::vector<SeenMarkers>* seen) {
  for (const char* dictionary : kWholeDictionaries) {
    for (const std::vector<Image>* images : {&pictures.grey, &pictures.negative, &pictures.mirrored}) {
      const auto markers = MarkersIn(*images, dictionary, num_threads);
      if (Count(markers) < kLeastMarkersSeen) continue;
      auto board = GuessCharuco(dictionary, markers, given);
      if (!board && images == &pictures.grey) seen->push_back(Seen(dictionary, markers));
      if (!board) continue;
      board->inverted = images == &pictures.negative;
      candidates->AddGuess(*board, images == &pictures.mirrored);
      break;
    }
  }
}

struct TagFinds {
  std::vector<MarkersOfImage> markers;
  std::vector<SeenTag> tags;
};

/// Corners of a lone tag by RefineCorner.
Eigen::Matrix<double, 2, 4> Refine(const std::string& family, const Tag& tag, const Image& grey) {
  Board board;
  board.kind = Board::Kind::kTag;
  board.cols = board.rows = 1;
  board.square_m = 1;
  board.dictionary = family;
  board.first_tag = tag.id;
  board.tag_border = tag.border;
  FoundMarkers found;
  found.px[tag.id] = tag.px;
  Eigen::Matrix<double, 2, 4> refined = Eigen::Matrix<double, 2, 4>::Constant(std::numeric_limits<double>::quiet_NaN());
  for (const CornerGuess& guess : PlaceCorners(board, found).guesses) {
    const RefinedCorner corner = RefineCorner(board, grey, guess);
    if (corner.status == Status::kOk) refined.col(guess.corner_id) = corner.px;
  }
  return refined;
}

TagFinds TagsIn(const std::vector<Image>& images, const TagFamily& family, int num_threads) {
  TagFinds finds;
  std::vector<std::vector<SeenTag>> seen(images.size());
  finds.markers.resize(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    const std::vector<Tag> narrow = FindTags(family, TagBorder::kNarrow, images[i]);
    std::vector<Tag> wide;
    if (!family.white_inside) wide = FindTags(family, TagBorder::kWide, images[i]);
    for (const Tag& tag : wide.size() > narrow.size() ? wide : narrow) {
      seen[i].push_back({static_cast<int>(i), family.name, tag.id, tag.border, tag.px, Refine(family.name, tag, images[i])});
      finds.markers[i][tag.id] = tag.px;
    }
  });
  for (auto& tags : seen) finds.tags.insert(finds.tags.end(), tags.begin(), tags.end());
  return finds;
}

/// The grid that the tags make, or each of them alone.
void AddBoardsOfTags(const TagFinds& finds, const std::string& family, int border, const std::optional<Board>& given,
                     bool mirrored, Candidates* candidates) {
  if (auto grid = GuessAprilGrid(family, finds.markers, given)) {
    grid->tag_border = border;
    candidates->AddGuess(*grid, mirrored);
    return;
  }
  std::set<int> ids;
  for (const SeenTag& tag : finds.tags) ids.insert(tag.id);
  for (int id : ids) {
    Board board;
    board.kind = Board::Kind::kTag;
    board.cols = board.rows = 1;
    board.dictionary = family;
    board.first_tag = id;
    board.tag_border = border;
    candidates->AddGuess(board, mirrored);
  }
}

/// AprilGrids and lone tags of every family, also mirrored; of the given one alone when it is seen. Fills `tags` with what is
/// seen in the images as they are.
void AddTagGuesses(const std::optional<Board>& given, const Pictures& pictures, int num_threads, Candidates* candidates,
                   std::vector<SeenTag>* tags) {
  std::vector<std::string> names = AllTagFamilies();
  const bool has_wish = given && given->has_tags();
  if (has_wish) std::stable_partition(names.begin(), names.end(), [&](const auto& name) { return name == given->dictionary; });
  for (const std::string& name : names) {
    const TagFamily family = *FindTagFamily(name);
    const TagFinds plain = TagsIn(pictures.grey, family, num_threads),
                   mirrored = TagsIn(pictures.mirrored, family, num_threads);
    const bool is_mirrored = mirrored.tags.size() > plain.tags.size();
    const TagFinds& finds = is_mirrored ? mirrored : plain;
    const bool asked = has_wish && given->dictionary == name;
    if (!asked && (family.num_tags < kFewTags || finds.tags.size() < kLeastMarkersSeen)) continue;
    if (!is_mirrored) tags->insert(tags->end(), finds.tags.begin(), finds.tags.end());
    const bool enough = asked && !finds.tags.empty();
    int wide = 0;
    for (const SeenTag& tag : finds.tags) wide += tag.border == 2 ? 1 : -1;
    AddBoardsOfTags(finds, name, wide > 0 ? 2 : 1, given, is_mirrored, candidates);
    if (enough) return;
  }
}

void AddChessboardGuesses(const Pictures& pictures, int num_threads, Candidates* candidates) {
  const int looks = std::min<int>(kChessboardLooks, static_cast<int>(pictures.grey.size()));
  std::vector<std::optional<std::pair<int, int>>> sizes(looks);
  ParallelFor(looks, num_threads,
              [&](int64_t i) { sizes[i] = GuessChessboard(pictures.grey[i * pictures.grey.size() / looks]); });
  for (const auto& size : sizes) {
    if (!size) continue;
    Board board;
    board.cols = std::max(size->first, size->second);
    board.rows = std::min(size->first, size->second);
    candidates->AddGuess(board, false);
  }
}

/// The candidate in its best layout, counted over all images.
BoardTrial Try(const Candidate& candidate, const Pictures& pictures, Detector detector, int num_threads) {
  const std::vector<Image>& images = pictures.For(candidate.mirrored);
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
      if (detections[l].status != Status::kOk) continue;
      ++trial.num_images;
      trial.num_corners += detections[l].detection.num_corners();
      sigmas.push_back(detections[l].sigma_px);
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

/// Tries the candidates that were added since the last time.
void TryNew(const Candidates& candidates, const std::optional<Board>& given, const Pictures& pictures, int num_threads,
            BoardCheckReport* report) {
  for (size_t i = report->trials.size(); i < candidates.list().size(); ++i) {
    BoardTrial trial = Try(candidates.list()[i], pictures, Detector::kFast, num_threads);
    trial.relation = RelationOf(trial.board, trial.mirrored, given);
    report->trials.push_back(std::move(trial));
  }
}

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

/// The slow search for the chessboard that came out best, unless it is in all images already.
void TryHarder(const std::optional<Board>& given, const Pictures& pictures, int num_threads, BoardCheckReport* report) {
  if (!report->best || report->trials[0].board.kind != Board::Kind::kChessboard) return;
  if (report->trials[0].num_images == report->num_images) return;
  BoardTrial trial = Try({report->trials[0].board, report->trials[0].mirrored}, pictures, Detector::kExact, num_threads);
  trial.relation = RelationOf(trial.board, trial.mirrored, given);
  report->trials[0] = std::move(trial);
}

}  // namespace

BoardCheckReport CheckBoard(const std::optional<Board>& given, const std::vector<Image>& images, const RunContext& run) {
  MVS_CHECK(!images.empty(), "no images");
  const Pictures pictures = Prepare(images);
  const int num_threads = run.num_threads;
  BoardCheckReport report;
  report.num_images = static_cast<int>(images.size());
  report.scale_known = given.has_value();
  Candidates candidates(given);
  ProgressStage stage(run, "looking for boards", 4);
  if (given) AddMiscounts(*given, &candidates);
  TryNew(candidates, given, pictures, num_threads, &report);
  stage.Advance(1, "the given board");
  const bool tags_asked = given && given->has_tags();
  if (!Fits(report, 0.8) || tags_asked) AddTagGuesses(given, pictures, num_threads, &candidates, &report.tags);
  stage.Advance(1, "AprilTag families");
  if (!Fits(report, 0.8) && !tags_asked) AddCharucoGuesses(given, pictures, num_threads, &candidates, &report.markers);
  TryNew(candidates, given, pictures, num_threads, &report);
  stage.Advance(1, "ArUco dictionaries");
  if (!Fits(report, 0.5) && !tags_asked) AddChessboardGuesses(pictures, num_threads, &candidates);
  TryNew(candidates, given, pictures, num_threads, &report);
  Sort(&report);
  TryHarder(given, pictures, num_threads, &report);
  stage.Advance(1, "chessboards");
  return report;
}

std::string BoardText(const Board& board, bool scale_known) {
  const std::string text = ToString(board);
  if (scale_known) return text;
  Board unit = board;
  unit.square_m = 1;
  unit.marker_m = board.marker_m / board.square_m;
  std::string unscaled = ToString(unit);
  const std::string side = "1000mm", name = board.has_tags() ? "SIDE" : "SQUARE";
  const size_t at = unscaled.find(":" + side);
  if (at != std::string::npos) unscaled.replace(at + 1, side.size(), name);
  if (board.kind != Board::Kind::kCharuco) return unscaled;
  const size_t marker = unscaled.find(':', at + 1) + 1, end = unscaled.find(':', marker);
  return unscaled.substr(0, marker) + Format("%.3g*", unit.marker_m) + name + unscaled.substr(end);
}

}  // namespace mvstudio::calib
