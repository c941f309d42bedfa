#include "calib/board/board_target.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/number_cell.h"
#include "core/text/words.h"

/// https://github.com/ethz-asl/kalibr/wiki/calibration-targets
namespace mvstudio::calib::internal {
namespace {

std::string Bare(const std::string& text) {
  constexpr char kAround[] = " \t\r\"'{}";
  const size_t first = text.find_first_not_of(kAround);
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(kAround) - first + 1);
}

/// The keys of a flat table, and those that nobody asked for.
class KalibrTarget {
 public:
  explicit KalibrTarget(const std::string& path) : path_(path) {
    std::istringstream lines(ReadFile(path));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream pairs(line.substr(0, line.find('#')));
      for (std::string pair; std::getline(pairs, pair, ',');) Add(pair);
    }
  }

  std::string Word(const std::string& key) {
    const auto found = values_.find(key);
    if (found == values_.end()) Fail(key, "this key is missing, which a target of Kalibr has");
    const std::string value = found->second;
    values_.erase(found);
    return value;
  }

  bool Has(const std::string& key) const { return values_.count(key) > 0; }

  double Positive(const std::string& key) {
    const std::string word = Word(key);
    const NumberCell cell = ReadNumberCell(word);
    if (cell.kind != NumberCell::Kind::kNumber || !(cell.value > 0)) Fail(key, "'" + word + "' is not a positive number");
    return cell.value;
  }

  std::string Count(const std::string& key) {
    const double value = Positive(key);
    if (value != std::floor(value) || value > 200) Fail(key, "'" + Format("%g", value) + "' is not a number from 1 to 200");
    return Format("%.0f", value);
  }

  /// Length in metres.
  std::string Metres(const std::string& key) {
    const double metres = Positive(key);
    if (metres > 1) Fail(key, Format("%g", metres) + " m is no board's: Kalibr's lengths are metres");
    return Format("%.12g", metres);
  }

  /// What is left would change the board.
  void RequireAllRead() const {
    for (const auto& [key, value] : values_)
      Fail(key, "is not known of this target; take it out if it does not change the board");
  }

  [[noreturn]] void Fail(const std::string& key, const std::string& what) const { throw FormatError(path_, key, what); }

 private:
  void Add(const std::string& pair) {
    const size_t colon = pair.find(':');
    const std::string key = Bare(pair.substr(0, colon));
    if (colon == std::string::npos || key.empty()) return;
    if (!values_.emplace(key, Bare(pair.substr(colon + 1))).second) Fail(key, "this key is there twice");
  }

  std::string path_;
  std::map<std::string, std::string> values_;
};

std::string CirclesText(KalibrTarget* target) {
  bool shifted = false;
  if (target->Has("asymmetricGrid")) {
    const std::string word = PlainWord(target->Word("asymmetricGrid"));
    shifted = word == "true" || word == "1" || word == "yes";
    if (!shifted && word != "false" && word != "0" && word != "no") target->Fail("asymmetricGrid", "is neither True nor False");
  }
  const std::string cols = target->Count("targetCols"), rows = target->Count("targetRows");
  return (shifted ? "acircles:" : "circles:") + cols + "x" + rows + ":" + target->Metres("spacingMeters") + "m";
}

}  // namespace

bool NamesTarget(const std::string& text) {
  const std::string extension = std::filesystem::path(text).extension().string();
  return (extension == ".yaml" || extension == ".yml" || extension == ".json") && text.rfind("points:", 0) != 0;
}

void RefuseFile(const std::string& text) {
  std::error_code error;
  if (!std::filesystem::exists(text, error)) return;
  throw UsageError("board '" + text +
                   "': is a file or folder, and no text of a board; footage is given as option 'camera' NAME=PATH, images as a "
                   "pattern in quotes: option 'camera' cam_01='images/cam_01*.jpg'");
}

std::string BoardTextOfTarget(const std::string& path) {
  if (const std::string text = ReadFile(path); IsMulticalBoards(text)) return BoardTextOfMultical(path, text);
  KalibrTarget target(path);
  const std::string type = PlainWord(target.Word("target_type"));
  std::string text;
  if (type == "aprilgrid") {
    const std::string cols = target.Count("tagCols"), rows = target.Count("tagRows"), side = target.Metres("tagSize");
    text = "aprilgrid:" + cols + "x" + rows + ":" + side + "m:" + Format("%.12g", target.Positive("tagSpacing"));
  } else if (type == "checkerboard") {
    const std::string cols = target.Count("targetCols"), rows = target.Count("targetRows");
    const std::string across = target.Metres("colSpacingMeters"), down = target.Metres("rowSpacingMeters");
    text = "chessboard:" + cols + "x" + rows + ":" + (across == down ? "" : across + "x") + down + "m";
  } else if (type == "circlegrid") {
    text = CirclesText(&target);
  } else {
    target.Fail("target_type", "'" + type + "' is not known here (aprilgrid, checkerboard, circlegrid)");
  }
  target.RequireAllRead();
  return text;
}

}  // namespace mvstudio::calib::internal
