#pragma once

#include <cctype>
#include <set>
#include <string>
#include <vector>

namespace mvstudio::report {

/// A tiny XML checker: tags nest and close, attributes are quoted and not repeated, text has no bare '<' or '&', entities are
/// known. Returns "" for a well-formed element, else what is wrong and where.
class MarkupChecker {
 public:
  explicit MarkupChecker(const std::string& text) : text_(text) {}

  std::string Run() {
    while (at_ < text_.size()) {
      if (text_[at_] == '<') {
        if (!ReadTag()) return error_;
      } else if (!ReadCharacter("<")) {
        return error_;
      }
    }
    if (!open_.empty()) return "not closed: " + open_.back();
    return num_roots_ == 1 ? "" : "there must be one root element, found " + std::to_string(num_roots_);
  }

 private:
  bool Fail(const std::string& what) {
    error_ = what + " at byte " + std::to_string(at_) + ": " + text_.substr(at_, 60);
    return false;
  }

  bool ReadCharacter(const std::string& forbidden) {
    const char c = text_[at_];
    if (forbidden.find(c) != std::string::npos) return Fail("unexpected character");
    if (open_.empty() && !std::isspace(static_cast<unsigned char>(c))) return Fail("text outside the root");
    if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') return Fail("control character");
    if (c != '&') return ++at_, true;
    const size_t end = text_.find(';', at_);
    static const std::set<std::string> kKnown = {"&amp", "&lt", "&gt", "&quot", "&#39"};
    if (end == std::string::npos || !kKnown.count(text_.substr(at_, end - at_))) return Fail("unknown entity");
    at_ = end + 1;
    return true;
  }

  std::string ReadName() {
    const size_t begin = at_;
    while (at_ < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at_])) || text_[at_] == '-' || text_[at_] == ':'))
      ++at_;
    return text_.substr(begin, at_ - begin);
  }

  bool ReadAttributes() {
    std::set<std::string> names;
    while (at_ < text_.size() && text_[at_] == ' ') {
      ++at_;
      const std::string name = ReadName();
      if (name.empty() || !names.insert(name).second) return Fail("attribute without a name or given twice");
      if (text_.compare(at_, 2, "=\"") != 0) return Fail("attribute without a quoted value");
      at_ += 2;
      open_.push_back("attribute");
      while (at_ < text_.size() && text_[at_] != '"') {
        if (!ReadCharacter("<")) return false;
      }
      open_.pop_back();
      ++at_;
    }
    return true;
  }

  bool ReadTag() {
    ++at_;
    const bool closing = at_ < text_.size() && text_[at_] == '/';
    if (closing) ++at_;
    const std::string name = ReadName();
    if (name.empty()) return Fail("tag without a name");
    if (closing) {
      if (open_.empty() || open_.back() != name) return Fail("closing tag does not match");
      open_.pop_back();
    } else {
      if (open_.empty()) ++num_roots_;
      if (!ReadAttributes()) return false;
      const bool empty = at_ < text_.size() && text_[at_] == '/';
      if (empty) ++at_;
      if (!empty) open_.push_back(name);
    }
    if (at_ >= text_.size() || text_[at_] != '>') return Fail("tag is not closed");
    ++at_;
    return true;
  }

  const std::string& text_;
  size_t at_ = 0;
  int num_roots_ = 0;
  std::vector<std::string> open_;
  std::string error_;
};

inline std::string CheckMarkup(const std::string& text) { return MarkupChecker(text).Run(); }

}  // namespace mvstudio::report
