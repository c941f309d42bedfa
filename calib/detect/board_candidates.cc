#include "calib/detect/board_candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "calib/board/apriltag.h"
#include "calib/board/circles.h"
#include "calib/board/guess.h"
#include "calib/detect/circle_search.h"
#include "calib/detect/corner_search.h"
#include "calib/detect/detect_board.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kFewImages = 5;      // that are looked at first
constexpr int kFewTags = 100;         // families with so few tags match clutter: they count only on request
constexpr int kLeastMarkersSeen = 3;  // in all images together, for a dictionary to count as seen

/// The dictionaries that hold all others as their beginning.
constexpr const char* kWholeDictionaries[] = {"4x4_1000",      "5x5_1000",       "6x6_1000",
                                              "7x7_1000",      "aruco_original", "apriltag_16h5",
                                              "apriltag_25h9", "apriltag_36h10", "apriltag_36h11"};

/// The position of the `i`-th of `looks` images evenly spread.
size_t At(int64_t i, int64_t looks, const TrialImages& trial_images) {
  return static_cast<size_t>(i) * trial_images.grey.size() / static_cast<size_t>(looks);
}

Image Negative(Image grey) {
  for (uint8_t& value : grey.pixels) value = 255 - value;
  return grey;
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

}  // namespace

void Candidates::Add(Board board, bool mirrored) {
  if (board.cols < 1 || board.rows < 1) return;
  if (board.kind == Board::Kind::kChessboard && std::min(board.cols, board.rows) < 3) return;
  if (board.kind == Board::Kind::kCharuco && std::min(board.cols, board.rows) < 2) return;
  if (!seen_.insert(ToString(board) + (mirrored ? " mirrored" : "")).second) return;
  list_.push_back({std::move(board), mirrored});
}

void Candidates::AddGuess(Board board, bool mirrored) {
  const double scale = given_ ? given_->square_m : 1;
  board.square_m = scale;
  if (board.is_round()) board.circle_m = UsualDiameter(board);
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

TrialImages Prepare(const std::vector<Image>& images) {
  TrialImages trial_images;
  for (const Image& image : images) {
    trial_images.grey.push_back(ToGrey(image));
    trial_images.mirrored.push_back(FlippedLeftRight(trial_images.grey.back()));
    trial_images.negative.push_back(Negative(trial_images.grey.back()));
  }
  return trial_images;
}

TrialImages AFew(const TrialImages& trial_images) {
  const auto looks = static_cast<int64_t>(std::min(kFewImages, trial_images.grey.size()));
  TrialImages few;
  for (int64_t i = 0; i < looks; ++i) {
    const size_t at = At(i, looks, trial_images);
    few.grey.push_back(trial_images.grey[at]);
    few.mirrored.push_back(trial_images.mirrored[at]);
    few.negative.push_back(trial_images.negative[at]);
  }
  return few;
}

/// Rows and columns exchanged; squares counted for corners (or the reverse), and both.
void AddMiscounts(const Board& given, Candidates* candidates) {
  const bool in_squares = given.kind == Board::Kind::kChessboard || given.kind == Board::Kind::kCharuco;
  if (!in_squares && given.kind != Board::Kind::kAprilGrid && !given.is_round()) return;
  for (const int more : {0, -1, 1}) {
    for (const bool exchanged : {false, true}) {
      Board board = given;
      if (exchanged) std::swap(board.cols, board.rows);
      if (exchanged && board.row_step_m > 0) std::swap(board.square_m, board.row_step_m);
      board.cols += more, board.rows += more;
      if (!in_squares && more != 0) continue;
      candidates->Add(board, false);
    }
  }
}

/// ChArUco boards that the markers tell, in any dictionary, also mirrored and in negative.
void AddCharucoGuesses(const std::optional<Board>& given, const TrialImages& trial_images, const MarkerKinds& kinds,
                       int num_threads, Candidates* candidates, std::vector<SeenMarkers>* seen, MarkerKinds* shown) {
  for (const char* dictionary : kWholeDictionaries) {
    if (!kinds.empty() && kinds.count(dictionary) == 0) continue;
    for (const std::vector<Image>* images : {&trial_images.grey, &trial_images.negative, &trial_images.mirrored}) {
      const auto markers = MarkersIn(*images, dictionary, num_threads);
      if (Count(markers) < kLeastMarkersSeen) continue;
      shown->insert(dictionary);
      auto board = GuessCharuco(dictionary, markers, given);
      if (!board && images == &trial_images.grey) seen->push_back(Seen(dictionary, markers));
      if (!board) continue;
      board->inverted = images == &trial_images.negative;
      candidates->AddGuess(*board, images == &trial_images.mirrored);
      break;
    }
  }
}

/// AprilGrids and lone tags of every family, also mirrored; of the given one alone when it is seen. Fills `tags` with what is
/// seen in the images as they are.
void AddTagGuesses(const std::optional<Board>& given, const TrialImages& trial_images, const MarkerKinds& kinds,
                   int num_threads, Candidates* candidates, std::vector<SeenTag>* tags, MarkerKinds* shown) {
  std::vector<std::string> names = AllTagFamilies();
  const bool has_wish = given && given->has_tags();
  if (has_wish) std::stable_partition(names.begin(), names.end(), [&](const auto& name) { return name == given->dictionary; });
  for (const std::string& name : names) {
    const bool asked = has_wish && given->dictionary == name;
    if (!asked && !kinds.empty() && kinds.count(name) == 0) continue;
    const TagFamily family = *FindTagFamily(name);
    const TagFinds plain = TagsIn(trial_images.grey, family, num_threads),
                   mirrored = TagsIn(trial_images.mirrored, family, num_threads);
    const bool is_mirrored = mirrored.tags.size() > plain.tags.size();
    const TagFinds& finds = is_mirrored ? mirrored : plain;
    if (!asked && (family.num_tags < kFewTags || finds.tags.size() < kLeastMarkersSeen)) continue;
    if (finds.tags.size() >= kLeastMarkersSeen) shown->insert(name);
    if (!is_mirrored) tags->insert(tags->end(), finds.tags.begin(), finds.tags.end());
    const bool enough = asked && !finds.tags.empty();
    int wide = 0;
    for (const SeenTag& tag : finds.tags) wide += tag.border == 2 ? 1 : -1;
    AddBoardsOfTags(finds, name, wide > 0 ? 2 : 1, given, is_mirrored, candidates);
    if (enough) return;
  }
}

std::vector<Board> GuessChessboards(const TrialImages& trial_images, int num_threads) {
  const int looks = static_cast<int>(std::min(kFewImages, trial_images.grey.size()));
  std::vector<std::optional<std::pair<int, int>>> sizes(looks);
  ParallelFor(looks, num_threads,
              [&](int64_t i) { sizes[i] = GuessChessboard(trial_images.grey[At(i, looks, trial_images)]); });
  const auto area = [](const auto& size) { return size ? size->first * size->second : 0; };
  std::stable_sort(sizes.begin(), sizes.end(), [&](const auto& a, const auto& b) { return area(a) > area(b); });
  std::vector<Board> boards;
  for (const auto& size : sizes) {
    if (!size) continue;
    Board board;
    board.cols = std::max(size->first, size->second);
    board.rows = std::min(size->first, size->second);
    board.square_m = 1;
    boards.push_back(board);
  }
  return boards;
}

void AddCircleGuesses(const TrialImages& trial_images, int num_threads, Candidates* candidates) {
  const int looks = static_cast<int>(std::min(kFewImages, trial_images.grey.size()));
  std::vector<std::optional<Board>> boards(static_cast<size_t>(looks));
  ParallelFor(looks, num_threads, [&](int64_t i) {
    const size_t at = At(i, looks, trial_images);
    for (const bool inverted : {false, true}) {
      for (const SpotLattice& lattice : FindLattices(FindSpots(inverted ? trial_images.negative[at] : trial_images.grey[at]))) {
        auto board = GuessCircles(lattice);
        if (!board || boards[static_cast<size_t>(i)]) continue;
        board->inverted = inverted;
        boards[static_cast<size_t>(i)] = board;
      }
    }
  });
  for (const auto& board : boards) {
    if (board) candidates->AddGuess(*board, false);
  }
}

}  // namespace mvstudio::calib
