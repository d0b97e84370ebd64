// What the studio's editor uses of CodeMirror.
export {EditorState, StateEffect, StateField, Transaction, Annotation, Compartment} from "@codemirror/state";
export {EditorView, Decoration, keymap, lineNumbers, highlightActiveLine, drawSelection, hoverTooltip} from "@codemirror/view";
export {defaultKeymap, history, historyKeymap, indentWithTab, undo, redo} from "@codemirror/commands";
export {syntaxHighlighting, HighlightStyle, bracketMatching, indentUnit} from "@codemirror/language";
export {autocompletion, completionKeymap, closeBrackets} from "@codemirror/autocomplete";
export {setDiagnostics, lintGutter, lintKeymap} from "@codemirror/lint";
export {searchKeymap, highlightSelectionMatches} from "@codemirror/search";
export {yaml} from "@codemirror/lang-yaml";
export {tags} from "@lezer/highlight";
