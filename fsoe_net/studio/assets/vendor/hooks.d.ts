// What the page uses of the hooks of Preact; written here.
type Ends = void | (() => void);
export function useState<T>(first: T): [T, (next: T | ((now: T) => T)) => void];
export function useRef<T>(first: T): { current: T };
export function useEffect(run: () => Ends, inputs?: unknown[]): void;
export function useLayoutEffect(run: () => Ends, inputs?: unknown[]): void;
export function useCallback<T>(call: T, inputs: unknown[]): T;
export function useMemo<T>(make: () => T, inputs: unknown[]): T;
