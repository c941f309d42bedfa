// Private: for board_check.cc.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/detect/board_check.h"

/// Boards that may be in the images of a check.
namespace mvstudio::calib {

/// The images as they are, mirrored, and in negative.
struct TrialImages {
  std::vector<Image> grey, mirrored, negative;
  const std::vector<Image>& For(bool in_mirror) const { return in_mirror ? mirrored : grey; }
};

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

  void Add(Board board, bool mirrored);
  /// A board that was guessed with square_m = 1.
  void AddGuess(Board board, bool mirrored);
  const std::vector<Candidate>& list() const { return list_; }

 private:
  std::optional<Board> given_;
  std::set<std::string> seen_;
  std::vector<Candidate> list_;
};

TrialImages Prepare(const std::vector<Image>& images);
/// A few of them, evenly spread.
TrialImages AFew(const TrialImages& trial_images);

/// Rows and columns exchanged; squares counted for corners (or the reverse), and both.
void AddMiscounts(const Board& given, Candidates* candidates);

/// Families and dictionaries that some images show: others need not be looked for in all. Empty: nothing is known.
using MarkerKinds = std::set<std::string>;

/// ChArUco boards that the markers tell, in any dictionary (of `kinds`), also mirrored and in negative. Adds to `shown`.
void AddCharucoGuesses(const std::optional<Board>& given, const TrialImages& trial_images, const MarkerKinds& kinds,
                       int num_threads, Candidates* candidates, std::vector<SeenMarkers>* seen, MarkerKinds* shown);

/// AprilGrids and lone tags of every family (of `kinds`), also mirrored; of the given one alone when it is seen. Fills `tags`
/// with what is seen in the images as they are. Adds to `shown`.
void AddTagGuesses(const std::optional<Board>& given, const TrialImages& trial_images, const MarkerKinds& kinds,
                   int num_threads, Candidates* candidates, std::vector<SeenTag>* tags, MarkerKinds* shown);

/// Chessboards in a few images, with squares of 1 m, the largest first; smaller ones may be parts of them.
std::vector<Board> GuessChessboards(const TrialImages& trial_images, int num_threads);

/// Grids of circles, dark or light.
void AddCircleGuesses(const TrialImages& trial_images, int num_threads, Candidates* candidates);

}  // namespace mvstudio::calib
