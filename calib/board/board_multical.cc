#include <algorithm>
#include <cctype>
#include <cmath>

#include "calib/board/board_target.h"
#include "calib/formats/document.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/words.h"

/// https://github.com/oliver-batchelor/multical: boards by name, with what they share in `common`.
namespace mvstudio::calib::internal {
namespace {

/// The table of a board with the keys of `common` that it lacks.
Value MulticalTable(const Value& board, const Value* common) {
  Value whole = board;
  for (size_t i = 0; common && i < common->entries.size(); ++i)
    AddEntry(common->entries[i].first, common->entries[i].second, &whole);
  return whole;
}

std::string MulticalCount(const ValueView& view) {
  const double number = view.Number();
  if (!(number >= 0 && number <= 100'000) || number != std::floor(number)) view.Fail("a whole number was expected");
  return Format("%.0f", number);
}

std::string MulticalSize(const ValueView& board) {
  const ValueView size = board["size"];
  if (size.ListSize() != 2) size.Fail("two numbers, columns and rows, were expected");
  return MulticalCount(size[0]) + "x" + MulticalCount(size[1]);
}

std::string MulticalMetres(const ValueView& view) {
  const double metres = view.Number();
  if (!(metres > 0 && metres <= 1)) view.Fail(Format("%g", metres) + " m is no board's: multical's lengths are metres");
  return Format("%.12gm", metres);
}

std::string MulticalFirst(const ValueView& board, const char* key) {
  const std::string first = board.Has(key) ? MulticalCount(board[key]) : "0";
  return first == "0" ? "" : ":first=" + first;
}

std::string MulticalText(const ValueView& board) {
  const std::string type = PlainWord(board["_type_"].Text());
  if (type == "charuco") {
    std::string dictionary = board["aruco_dict"].Text();
    std::transform(dictionary.begin(), dictionary.end(), dictionary.begin(), [](unsigned char c) { return std::tolower(c); });
    return "charuco:" + MulticalSize(board) + ":" + MulticalMetres(board["square_length"]) + ":" +
           MulticalMetres(board["marker_length"]) + ":" + dictionary + MulticalFirst(board, "aruco_offset");
  }
  if (type == "aprilgrid") {
    const std::string family = board.Has("tag_family") ? board["tag_family"].Text() : "t36h11";
    return "aprilgrid:" + MulticalSize(board) + ":" + MulticalMetres(board["tag_length"]) + ":" +
           Format("%.12g", board["tag_spacing"].Number()) + ":" + family.substr(family[0] == 't') +
           MulticalFirst(board, "start_id");
  }
  board["_type_"].Fail("'" + board["_type_"].Text() + "' is not known here (charuco, aprilgrid)");
}

}  // namespace

bool IsMulticalBoards(std::string_view text) { return text.find("_type_:") != std::string_view::npos; }

std::string BoardTextOfMultical(const std::string& path, const std::string& text) {
  const Value document = ParseYaml(path, text);
  const ValueView root(path, document);
  const Value* const common = root.Has("common") ? &root["common"].value() : nullptr;
  std::vector<std::string> texts;
  for (const auto& [name, table] : root["boards"].value().entries) {
    const Value board = MulticalTable(table, common);
    texts.push_back(MulticalText(ValueView(path, board, "boards." + Printable(name))));
  }
  if (texts.empty()) root["boards"].Fail("holds no board");
  if (texts.size() > 1)
    throw UsageError("board '" + path + "': holds " + std::to_string(texts.size()) +
                     " boards of multical; name each: option 'board' " + Join(texts, " option 'board' "));
  return texts[0];
}

}  // namespace mvstudio::calib::internal
