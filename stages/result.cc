#include "stages/result.h"

#include <iterator>
#include <utility>

namespace mvstudio::stages {
namespace {

template <class T>
void MoveTo(std::vector<T> from, std::vector<T>* to) {
  to->insert(to->end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

}  // namespace

void CommandResult::Add(CommandResult part) {
  if (part.exit != kExitOk) exit = part.exit;
  partial = partial || part.partial;
  for (auto& [key, value] : part.metrics.items()) metrics[key] = std::move(value);
  MoveTo(std::move(part.warnings), &warnings);
  MoveTo(std::move(part.errors), &errors);
  MoveTo(std::move(part.inputs), &inputs);
  MoveTo(std::move(part.outputs), &outputs);
  text += part.text;
}

}  // namespace mvstudio::stages
