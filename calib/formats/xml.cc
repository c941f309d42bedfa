#include "calib/formats/xml.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "calib/formats/format_text.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

constexpr int kMostXmlLevels = 64;

[[noreturn]] void FailAtByte(const std::string& path, const std::string& text, std::ptrdiff_t byte, const std::string& what) {
  const auto end = text.begin() + std::clamp<std::ptrdiff_t>(byte, 0, static_cast<std::ptrdiff_t>(text.size()));
  throw FormatError(path, "line " + std::to_string(1 + std::count(text.begin(), end, '\n')), what);
}

/// Looks at every node; neither the parser nor the walk calls itself, so that no file is too deep for them.
class XmlCheck : public pugi::xml_tree_walker {
 public:
  XmlCheck(const std::string& path, const std::string& text) : path_(path), text_(text) {}

  bool for_each(pugi::xml_node& node) override {
    const auto fail = [&](const std::string& what) { FailAtByte(path_, text_, node.offset_debug(), what); };
    if (node.type() == pugi::node_doctype) fail("document type definitions are not read");
    if (depth() >= kMostXmlLevels) fail("nested deeper than " + std::to_string(kMostXmlLevels) + " levels");
    std::set<std::string_view> names;
    for (const pugi::xml_attribute& attribute : node.attributes()) {
      if (!names.insert(attribute.name()).second) fail("attribute '" + Printable(attribute.name()) + "' occurs twice");
    }
    return true;
  }

 private:
  const std::string &path_, &text_;
};

std::string WhyNotXml(const pugi::xml_parse_result& result, bool at_end) {
  if (result.status == pugi::status_no_document_element) return "there is no element in it; is the file truncated?";
  if (at_end) return "an element is not closed; is the file truncated?";
  if (result.status == pugi::status_end_element_mismatch) return "an element is closed that is not the open one";
  return "not valid XML (" + std::string(result.description()) + ")";
}

}  // namespace

void ParseXml(const std::string& path, const std::string& text, pugi::xml_document* document) {
  const size_t nul = text.find('\0');
  if (nul != std::string::npos) FailAtByte(path, text, static_cast<std::ptrdiff_t>(nul), "a NUL byte; is it a text file?");
  const auto result = document->load_buffer(text.data(), text.size(), pugi::parse_default | pugi::parse_doctype);
  const size_t last = text.find_last_not_of(" \t\r\n") + 1;
  if (!result) FailAtByte(path, text, result.offset, WhyNotXml(result, result.offset + 1 >= static_cast<std::ptrdiff_t>(last)));
  XmlCheck check(path, text);
  document->traverse(check);
}

}  // namespace mvstudio::calib::internal
