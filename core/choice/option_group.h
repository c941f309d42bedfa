#pragma once

#include <type_traits>
#include <utility>

namespace mvstudio {

/// Whether a visitor of fields (core/fields.h) takes notice of their subjects.
template <class Visitor, class = void>
inline constexpr bool kKnowsGroups = false;
template <class Visitor>
inline constexpr bool kKnowsGroups<Visitor, std::void_t<decltype(std::declval<Visitor&>().StartGroup(""))>> = true;

/// Within VisitFields: the fields that follow belong to this subject, under which help lists them. A subject may be named again
/// later. Visitors that know no subjects do not notice.
template <class Visitor>
void StartGroup([[maybe_unused]] Visitor& visit, [[maybe_unused]] const char* subject) {
  if constexpr (kKnowsGroups<Visitor>) visit.StartGroup(subject);
}

}  // namespace mvstudio
