#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>
#include <vector>

#include "calib/board/board_target.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/number_cell.h"
#include "core/text/words.h"

/// https://github.com/oliver-batchelor/multical: boards by name, with what they share in `common`.
namespace mvstudio::calib::internal {
namespace {

std::string MulticalWord(const std::string& text) {
  constexpr char kAround[] = " \t\r\"'[]";
  const size_t first = text.find_first_not_of(kAround);
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(kAround) - first + 1);
}

/// The values of a YAML of nested keys, one a line, by their paths: "boards/a/size".
class MulticalFile {
 public:
  MulticalFile(const std::string& path, const std::string& text) : path_(path) {
    std::istringstream lines(text);
    std::vector<std::pair<size_t, std::string>> open;  // indents and keys
    for (std::string line; std::getline(lines, line);) {
      line.resize(std::min(line.find('#'), line.size()));
      const size_t indent = line.find_first_not_of(" \t"), colon = line.find(':');
      if (indent == std::string::npos || colon == std::string::npos) continue;
      while (!open.empty() && open.back().first >= indent) open.pop_back();
      open.emplace_back(indent, MulticalWord(line.substr(indent, colon - indent)));
      std::string key;
      for (const auto& [at, part] : open) key += (key.empty() ? "" : "/") + part;
      if (open.size() == 2 && open[0].second == "boards") boards.push_back(open[1].second);
      values_[key] = MulticalWord(line.substr(colon + 1));
    }
  }

  /// Of the board, else of all; empty: neither has it.
  std::string Word(const std::string& board, const std::string& key) const {
    for (const std::string& where : {"boards/" + board + "/" + key, "common/" + key}) {
      const auto found = values_.find(where);
      if (found != values_.end()) return found->second;
    }
    return "";
  }

  std::string Needed(const std::string& board, const std::string& key) const {
    const std::string word = Word(board, key);
    if (word.empty()) Fail(board, key, "is missing, which a board of multical has");
    return word;
  }

  double Number(const std::string& board, const std::string& key, const std::string& word) const {
    const NumberCell cell = ReadNumberCell(word);
    if (cell.kind != NumberCell::Kind::kNumber || !(cell.value >= 0))
      Fail(board, key, "'" + word + "' is not a number of a board");
    return cell.value;
  }

  std::string Count(const std::string& board, const std::string& key, const std::string& word) const {
    const double number = Number(board, key, word);
    if (number > 100'000 || number != std::floor(number)) Fail(board, key, "'" + word + "' is not a whole number of a board");
    return Format("%.0f", number);
  }

  std::string Metres(const std::string& board, const std::string& key) const {
    const double metres = Number(board, key, Needed(board, key));
    if (!(metres > 0 && metres <= 1))
      Fail(board, key, Format("%g", metres) + " m is no board's: multical's lengths are metres");
    return Format("%.12gm", metres);
  }

  /// Columns and rows.
  std::string Size(const std::string& board) const {
    const std::string word = Needed(board, "size");
    const size_t comma = word.find(',');
    if (comma == std::string::npos) Fail(board, "size", "two numbers, columns and rows, were expected");
    return Count(board, "size", MulticalWord(word.substr(0, comma))) + "x" +
           Count(board, "size", MulticalWord(word.substr(comma + 1)));
  }

  std::string First(const std::string& board, const std::string& key) const {
    const std::string word = Word(board, key), first = word.empty() ? "0" : Count(board, key, word);
    return first == "0" ? "" : ":first=" + first;
  }

  [[noreturn]] void Fail(const std::string& board, const std::string& key, const std::string& what) const {
    throw FormatError(path_, "boards." + board + "." + key, what);
  }

  std::vector<std::string> boards;  ///< names

 private:
  std::string path_;
  std::map<std::string, std::string> values_;
};

std::string MulticalText(const MulticalFile& file, const std::string& board) {
  const std::string stated = file.Needed(board, "_type_"), type = PlainWord(stated);
  if (type == "charuco") {
    std::string dictionary = file.Needed(board, "aruco_dict");
    std::transform(dictionary.begin(), dictionary.end(), dictionary.begin(), [](unsigned char c) { return std::tolower(c); });
    return "charuco:" + file.Size(board) + ":" + file.Metres(board, "square_length") + ":" +
           file.Metres(board, "marker_length") + ":" + dictionary + file.First(board, "aruco_offset");
  }
  if (type == "aprilgrid") {
    const std::string word = file.Word(board, "tag_family"), family = word.empty() ? "t36h11" : word;
    return "aprilgrid:" + file.Size(board) + ":" + file.Metres(board, "tag_length") + ":" +
           Format("%.12g", file.Number(board, "tag_spacing", file.Needed(board, "tag_spacing"))) + ":" +
           family.substr(family[0] == 't' ? 1 : 0) + file.First(board, "start_id");
  }
  file.Fail(board, "_type_", "'" + stated + "' is not known here (charuco, aprilgrid)");
}

}  // namespace

bool IsMulticalBoards(std::string_view text) { return text.find("_type_:") != std::string_view::npos; }

std::string BoardTextOfMultical(const std::string& path, const std::string& text) {
  const MulticalFile file(path, text);
  std::vector<std::string> texts;
  for (const std::string& board : file.boards) texts.push_back(MulticalText(file, board));
  if (texts.empty()) throw FormatError(path, "boards", "holds no board");
  if (texts.size() > 1)
    throw UsageError("board '" + path + "': holds " + std::to_string(texts.size()) +
                     " boards of multical; name each: option 'board' " + Join(texts, " option 'board' "));
  return texts[0];
}

}  // namespace mvstudio::calib::internal
