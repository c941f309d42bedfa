#include "core/csv.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"

namespace mvstudio {
namespace {

constexpr char kBlanks[] = " \t\r";

std::string_view WithoutBlanks(std::string_view text) {
  const size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) + 1 - first);
}

void Drop(size_t count, std::string_view* text) { text->remove_prefix(std::min(count, text->size())); }

}  // namespace

CsvReader::CsvReader(std::string path, std::string_view text) : path_(std::move(path)), rest_(text) { DropByteOrderMark(); }

CsvReader::CsvReader(std::string path, std::function<bool(std::string*)> append)
    : path_(std::move(path)), append_(std::move(append)) {
  AppendPiece();
  DropByteOrderMark();
}

void CsvReader::DropByteOrderMark() {
  if (rest_.substr(0, 3) == "\xef\xbb\xbf") Drop(3, &rest_);
}

/// The rest with the next piece behind it; false when there is none.
bool CsvReader::AppendPiece() {
  if (!append_) return false;
  std::string longer(rest_);
  const bool came = append_(&longer);
  if (!came) append_ = nullptr;
  piece_ = std::move(longer);
  rest_ = piece_;
  return came;
}

bool CsvReader::NextLine() {
  for (;;) {
    size_t end = rest_.find('\n');
    if (end == std::string_view::npos && AppendPiece()) continue;
    if (rest_.empty()) return false;
    end = std::min(end, rest_.size());
    line_ = WithoutBlanks(rest_.substr(0, end));
    is_cut_ = end == rest_.size();
    Drop(end + 1, &rest_);
    ++line_number_;
    if (!line_.empty()) return true;
  }
}

const std::vector<std::string_view>& CsvReader::Cells() {
  cells_.clear();
  unquoted_.clear();
  std::string_view rest = line_;
  for (bool more = true; more;) {
    Drop(std::min(rest.find_first_not_of(kBlanks), rest.size()), &rest);
    if (!rest.empty() && rest[0] == '"') {
      cells_.push_back(TakeQuoted(&rest));
      rest = WithoutBlanks(rest);
      if (!rest.empty() && rest[0] != ',') Fail("a comma was expected behind the cell in quotes");
    } else {
      const size_t end = std::min(rest.find(','), rest.size());
      cells_.push_back(WithoutBlanks(rest.substr(0, end)));
      Drop(end, &rest);
    }
    more = !rest.empty();
    Drop(1, &rest);
  }
  if (!has_header_) CheckSeparator();
  has_header_ = true;
  return cells_;
}

void CsvReader::CheckSeparator() const {
  const size_t other = line_.find_first_of(";\t");
  if (cells_.size() > 1 || other == std::string_view::npos) return;
  Fail(std::string("no comma, but ") + (line_[other] == ';' ? "';'" : "tabs") +
       ": save the table with commas between the cells and decimal points in numbers");
}

/// The cell in quotes that `rest` begins with; leaves what stands behind it.
std::string_view CsvReader::TakeQuoted(std::string_view* rest) {
  bool doubled = false;
  size_t end = rest->find('"', 1);
  while (end != std::string_view::npos && rest->substr(end + 1, 1) == "\"") doubled = true, end = rest->find('"', end + 2);
  if (end == std::string_view::npos) Fail("a quote does not end in this line; is the line cut off, or a line break in quotes?");
  const std::string_view inside = rest->substr(1, end - 1);
  Drop(end + 1, rest);
  if (!doubled) return inside;
  std::string& plain = unquoted_.emplace_back();
  for (size_t i = 0; i < inside.size(); ++i) {
    plain += inside[i];
    if (inside[i] == '"') ++i;
  }
  return plain;
}

void CsvReader::RequireCells(size_t count) const {
  if (cells_.size() == count) return;
  Fail(std::to_string(cells_.size()) + " columns, the header has " + std::to_string(count) +
       (cells_.size() < count ? "; is the line damaged or cut off?" : "; decimal commas, or texts with commas and no quotes?"));
}

void CsvReader::Fail(const std::string& what) const { throw FormatError(path_, Where(), what); }

int64_t ReadFrameNumber(std::string_view text, int64_t most, std::string* why) {
  int64_t number = -1;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  const bool zeros = at != end && *at == '.' && std::all_of(at + 1, end, [](char c) { return c == '0'; });
  const bool whole = at != text.data() && (at == end || zeros) && error != std::errc::invalid_argument;
  if (whole && error == std::errc() && number >= 0 && number <= most) return number;
  *why = "is `" + std::string(text) + "`, ";
  if (!whole) {
    *why += "not a whole number" + DecimalCommaHint(text);
  } else if (text[0] == '-') {
    *why += "and frames are counted from 0";
  } else {
    *why += "which is too large: frame numbers end at " + std::to_string(most) +
            "; number the frames from 0, and put time stamps into a table of their own";
  }
  return -1;
}

std::string WhyNoNumber(std::string_view text) {
  const bool digits = !text.empty() && text.find_first_not_of("0123456789", text[0] == '-' ? 1 : 0) == std::string_view::npos;
  return digits && text.size() > 1 ? "which is too large" : "not a number" + DecimalCommaHint(text);
}

std::string CsvCell(std::string_view text) {
  const bool bare = text.find_first_of(",\"") == std::string_view::npos && WithoutBlanks(text).size() == text.size() &&
                    text.substr(0, 1) != "#";
  if (bare) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string DecimalCommaHint(std::string_view text) {
  const size_t comma = text.find(',');
  const bool numeric = !text.empty() && text.find_first_not_of("0123456789+-.eE,") == std::string_view::npos;
  return numeric && comma != std::string_view::npos && text.find(',', comma + 1) == std::string_view::npos
             ? "; is its comma a decimal point?"
             : "";
}

}  // namespace mvstudio
