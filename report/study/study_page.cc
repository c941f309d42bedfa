#include "report/study/study_page.h"

#include "report/page/html.h"
#include "report/page/image.h"
#include "report/page/value.h"

namespace mvstudio::report {
namespace {

constexpr char kStyle[] = R"css(
.study{max-width:76rem;margin:0 auto}
.trio{display:grid;grid-template-columns:1fr 1fr 1fr;gap:.8rem;align-items:end;margin:1rem 0}
.trio figure{margin:0;text-align:center}.trio img{width:100%;max-width:24rem;margin:0 auto;border:1px solid var(--rule)}
.trio figure.truth img{border:2px solid var(--ink)}
.choose{display:grid;grid-template-columns:1fr 1fr 1fr;gap:.8rem}
button{font:inherit;padding:.6rem 1rem;border:1px solid var(--muted);border-radius:.4rem;background:var(--card);color:var(--ink);cursor:pointer}
button:focus-visible{outline:3px solid var(--c0)}
input{font:inherit;padding:.4rem .6rem}
textarea{width:100%;height:8rem}
[hidden]{display:none}
)css";

constexpr char kScript[] = R"js(
'use strict';
(function () {
  const data = JSON.parse(document.getElementById('data').textContent);
  const part = function (id) { return document.getElementById(id); };
  const answers = [];
  let shown_at = 0;
  function show(id) {
    for (const one of ['begin', 'ask', 'end']) part(one).hidden = one !== id;
  }
  function ask() {
    const index = answers.length;
    if (index === data.questions.length) return finish();
    const question = data.questions[index];
    part('left').src = question.left;
    part('truth').src = question.truth;
    part('right').src = question.right;
    part('count').textContent = (index + 1) + ' of ' + data.questions.length;
    part('back').disabled = index === 0;
    show('ask');
    shown_at = performance.now();
  }
  function choose(side) {
    if (part('ask').hidden) return;
    const question = data.questions[answers.length];
    answers.push({picture: question.picture, seal: question.seal, choice: side,
                  seconds: Math.round(performance.now() - shown_at) / 1000});
    ask();
  }
  function back() {
    if (part('begin').hidden && answers.length > 0) {
      answers.pop();
      ask();
    }
  }
  function rater() {
    const name = part('rater').value.trim();
    if (name) return name;
    const numbers = new Uint32Array(1);
    crypto.getRandomValues(numbers);
    return 'rater-' + numbers[0].toString(16);
  }
  function base64(text) {
    let bytes = '';
    for (const byte of new TextEncoder().encode(text)) bytes += String.fromCharCode(byte);
    return btoa(bytes);
  }
  let name = '';
  function finish() {
    name = name || rater();
    const text = JSON.stringify({schema: data.answers_schema, study: data.study, methods: data.methods, rater: name,
                                 answers: answers}, null, 1) + '\n';
    const save = part('save');
    save.href = 'data:application/json;base64,' + base64(text);
    save.download = 'answers-' + data.study.slice(0, 8) + '-' + name.replace(/[^A-Za-z0-9_-]+/g, '_') + '.json';
    part('text').value = text;
    show('end');
    save.focus();
  }
  part('start').addEventListener('click', ask);
  part('choose-left').addEventListener('click', function () { choose('left'); });
  part('choose-right').addEventListener('click', function () { choose('right'); });
  part('back').addEventListener('click', back);
  part('again').addEventListener('click', back);
  document.addEventListener('keydown', function (event) {
    if (event.repeat || event.target.tagName === 'INPUT' || event.target.tagName === 'TEXTAREA') return;
    if (event.key === 'ArrowLeft') choose('left');
    else if (event.key === 'ArrowRight') choose('right');
    else if (event.key === 'Backspace') back();
    else return;
    event.preventDefault();
  });
  show('begin');
})();
)js";

constexpr char kBody[] = R"html(
<section id="begin">
<p>You will see three images at a time. The one in the middle is real. <strong>Which of the other two is more like it?</strong>
There is always an answer to give: take your first impression when you see no difference. Left and right have nothing to do with each
other from one question to the next.</p>
<p><label>Your name or initials (may stay empty): <input id="rater" autocomplete="off" maxlength="60"></label></p>
<p><button id="start">Start</button></p>
</section>
<section id="ask" hidden>
<p>Which is more like the middle one? <span class="muted" id="count"></span></p>
<div class="trio">
<figure><img id="left" alt="left image"><figcaption>left</figcaption></figure>
<figure class="truth"><img id="truth" alt="the truth"><figcaption>the truth</figcaption></figure>
<figure><img id="right" alt="right image"><figcaption>right</figcaption></figure>
</div>
<div class="choose"><button id="choose-left">&#8592; Left</button><button id="back">Take back</button>
<button id="choose-right">Right &#8594;</button></div>
<p class="muted">Keys: arrow left, arrow right; Backspace takes the last answer back.</p>
</section>
<section id="end" hidden>
<p>Thank you. Your answers are not sent anywhere: save the file and pass it on.</p>
<p><a id="save" href="#">Save the answers</a> &#160; <button id="again">Take the last answer back</button></p>
<details><summary>The file as text</summary><textarea id="text" readonly aria-label="answers"></textarea></details>
</section>
<noscript><p>This page needs JavaScript to ask its questions; it loads nothing from anywhere.</p></noscript>
)html";

std::string DataUri(const std::string& bytes) { return "data:" + ImageType(bytes) + ";base64," + Base64(bytes); }

/// JSON that cannot end the script element that holds it.
std::string ForScript(const std::string& json) {
  std::string out;
  for (const char c : json) out += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return out;
}

std::string DataJson(const StudySpec& spec, const std::string& sha256, const std::vector<StudyQuestion>& questions) {
  Value list = Value::Array();
  for (const StudyQuestion& question : questions) {
    const StudyImage& image = *question.image;
    list.Append(Value::Object()
                    .Set("picture", image.name)
                    .Set("seal", question.seal)
                    .Set("left", DataUri(question.a_left ? image.a : image.b))
                    .Set("truth", DataUri(image.truth))
                    .Set("right", DataUri(question.a_left ? image.b : image.a)));
  }
  return Value::Object()
      .Set("answers_schema", kStudyAnswersSchema)
      .Set("study", sha256)
      .Set("methods", Value::Array().Append(spec.methods[0]).Append(spec.methods[1]))
      .Set("questions", list)
      .Dump();
}

}  // namespace

std::string StudyPageHtml(const StudySpec& spec, const std::string& sha256, const std::vector<StudyQuestion>& questions) {
  const std::string title = EscapeHtml(spec.title.empty() ? "Which image is closer?" : spec.title);
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
         "'unsafe-inline'; script-src " +
         ScriptSource(kScript) + "\">\n<meta name=\"color-scheme\" content=\"light dark\">\n<title>" + title +
         "</title>\n<style>\n" + std::string(PageStyle()) + kStyle + "</style>\n</head>\n<body>\n<main class=\"study\">\n<h1>" +
         title + "</h1>" + kBody + "</main>\n<footer>Study " + sha256.substr(0, 12) + ", " + std::to_string(questions.size()) +
         " questions</footer>\n<script type=\"application/json\" id=\"data\">" + ForScript(DataJson(spec, sha256, questions)) +
         "</script>\n<script>" + kScript + "</script>\n</body>\n</html>\n";
}

}  // namespace mvstudio::report
